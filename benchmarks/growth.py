"""Time and peak memory of `identify-run` against the length of a recording, 1 minute to 2 hours at 1 and 10 kHz.

python -m benchmarks.growth --out benchmarks/kept

Each recording is written block by block (benchmarks/long_recording.py) and identified by the command in a process of
its own, whose peak resident memory the system keeps count of (Linux and macOS).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.kept import Result, parser_of, print_and_write
from benchmarks.long_recording import TRUTH, write_h5

MINUTES = ((1.0, 1000.0), (20.0, 1000.0), (120.0, 1000.0), (1.0, 10_000.0), (12.0, 10_000.0), (120.0, 10_000.0))
SMALL = ((1.0, 1000.0), (20.0, 1000.0))
KIB = 1024.0 if sys.platform == "linux" else 1.0  # of the unit of ru_maxrss in bytes
CONFIG = (
    "backend: recorded\nrecorded:\n  runs: [{file: r.h5}]\n"
    f"model: {{inertia_kg_m2: {TRUTH['inertia']}, damping_nm_s_rad: {TRUTH['damping']}, "
    f"stiffness_nm_rad: {TRUTH['stiffness']}}}\n"
)


def one(folder: Path, minutes: float, rate_hz: float) -> dict[str, Any]:
    """One length: seconds and MiB."""
    samples = round(60.0 * minutes * rate_hz)
    write_h5(folder / "r.h5", samples, rate_hz)
    (folder / "rig.yaml").write_text(CONFIG, encoding="utf-8")
    run = [sys.executable, "-c", "from commands.identify_run import main; main()", "rig.yaml", "--quiet"]
    began = time.perf_counter()
    process = subprocess.Popen([*run, "--out", str(folder / "out")], cwd=folder, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    took = time.perf_counter() - began
    process.returncode = os.waitstatus_to_exitcode(status)
    (folder / "r.h5").unlink()
    return {
        "minutes": minutes, "kHz": rate_hz / 1000.0, "samples": samples, "s": took,
        "cpu s": usage.ru_utime + usage.ru_stime, "peak MiB": usage.ru_maxrss * KIB / 2**20,
        "exit code": process.returncode,
    }  # fmt: skip


def result_of(small: bool) -> Result:
    """The table at its size."""
    rows = []
    for minutes, rate_hz in SMALL if small else MINUTES:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(one(Path(folder), minutes, rate_hz))
    short, long = rows[0], rows[-1]
    ratios = {
        "samples times over processor time times, shortest to longest": (long["samples"] / short["samples"])
        / (long["cpu s"] / short["cpu s"]),
        "GiB over peak memory, largest": 1024.0 / max(row["peak MiB"] for row in rows),
    }
    return Result("growth", {"lengths": len(rows)}, [0], ratios, rows)


def main() -> None:
    """Print the table."""
    given = parser_of(__doc__).parse_args()
    print_and_write(result_of(given.small), given.out, given.small)


if __name__ == "__main__":
    main()
