"""Give field cases to the tool: `python -m benchmarks.field.run DIR`.

Every case of DIR/cases is one process, one after the other. DIR/results/NNNN is what the tool wrote,
DIR/results/NNNN.run.json how it ended. Cases that were run already are left alone, so a stopped bench goes on.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

LIMIT_S = 300.0
POLL_S = 0.05


def run_one(case: Path, results: Path, command: Sequence[str], limit_s: float) -> dict[str, Any]:
    """Run the tool on a case. Gives exit code (-1: stopped at the limit), wall and processor seconds, peak MiB."""
    shutil.rmtree(results, ignore_errors=True)  # what a stopped bench has left
    results.parent.mkdir(parents=True, exist_ok=True)
    begin = time.monotonic()
    late = False
    with results.with_suffix(".log").open("w", encoding="utf-8") as log:
        line = [*command, str(case / "rig.yaml"), "--out", str(results), "--quiet"]
        process = subprocess.Popen(
            line, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )
        try:
            while True:
                done, status, used = os.wait4(process.pid, os.WNOHANG)
                if done:
                    break
                if not late and time.monotonic() - begin > limit_s:
                    late = True
                    os.killpg(process.pid, signal.SIGKILL)
                time.sleep(POLL_S)
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    code = os.waitstatus_to_exitcode(status)
    process.returncode = code
    return {
        "exit_code": -1 if late else code, "seconds": time.monotonic() - begin,
        "cpu_seconds": used.ru_utime + used.ru_stime, "peak_mib": used.ru_maxrss / 1024.0,
    }  # fmt: skip


def run(out: Path, command: Sequence[str], limit_s: float, only: Sequence[int] = (), again: bool = False) -> None:
    """Run all cases of a bench that were not run yet."""
    for case in sorted((out / "cases").iterdir()):
        if only and int(case.name) not in only:
            continue
        results = out / "results" / case.name
        record = out / "results" / f"{case.name}.run.json"
        if not record.exists() or again:
            found = run_one(case, results, command, limit_s)
            record.write_text(json.dumps(found) + "\n", encoding="utf-8")
            said = f"exit {found['exit_code']}, {found['seconds']:.1f} s, {found['peak_mib']:.0f} MiB"
            print(f"{case.name}: {said}", file=sys.stderr, flush=True)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="DIR")
    parser.add_argument("--command", default=str(Path(sys.executable).parent / "identify-run"), help="what to run")
    parser.add_argument("--limit-s", type=float, default=LIMIT_S, help="a case that takes longer is stopped")
    parser.add_argument("--only", nargs="*", type=int, default=[], help="only the cases of these numbers")
    parser.add_argument("--again", action="store_true", help="also those that were run already")
    a = parser.parse_args()
    run(a.out, shlex.split(a.command), a.limit_s, a.only, a.again)


if __name__ == "__main__":
    main()
