"""Frozen recordings identified before and after a change that may change no number.

python -m benchmarks.frozen record DIR             write some forty short recordings, the same each time
python -m benchmarks.frozen identify DIR OUT       identify-run over each, its result.json kept as OUT/NAME.json
python -m benchmarks.frozen compare OUT1 OUT2      every difference between two such folders; exit code 1 where any is
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks.frozen.comparison import RENAMED, compare
from benchmarks.frozen.recordings import record

TIME_LIMIT_S = 900.0  # of one recording
ENDED = (0, 1)  # exit codes of identify-run with a result: accepted or not


def identified(recording: Path, out: Path) -> str:
    """Run the installed command on one recording and keep its result.json. Returns a line about it."""
    command = Path(sys.executable).parent / "identify-run"
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "results"
        done = subprocess.run(
            [str(command), str(recording / "rig.yaml"), "--out", str(results), "--quiet"],
            capture_output=True, text=True, timeout=TIME_LIMIT_S, check=False,
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        ended = done.returncode in ENDED
        content = json.loads((results / "result.json").read_text(encoding="utf-8")) if ended else {}
    content = {"exit_code": done.returncode} | content
    if not ended:
        content["error"] = done.stderr.strip().splitlines()[-1:]
    (out / f"{recording.name}.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    named = content["verdict"]["effects"] if ended else content["error"]
    return f"{recording.name}: exit code {done.returncode}, {', '.join(named) or 'nothing named'}"


def identify(recordings: Path, out: Path, processes: int, only: Sequence[str] = ()) -> int:
    """Identify every recording of a folder. Returns how many there are."""
    out.mkdir(parents=True, exist_ok=True)
    folders = [p.parent for p in sorted(recordings.glob("*/rig.yaml")) if not only or p.parent.name in only]
    with ThreadPoolExecutor(processes) as workers:
        for line in workers.map(lambda folder: identified(folder, out), folders):
            print(line, flush=True)
    return len(folders)


def main(given: Sequence[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    writes = commands.add_parser("record", help="write the recordings")
    writes.add_argument("dir", type=Path)
    runs = commands.add_parser("identify", help="identify every recording")
    runs.add_argument("dir", type=Path)
    runs.add_argument("out", type=Path)
    runs.add_argument("--processes", type=int, choices=(1, 2), default=2)
    for one in (writes, runs):
        one.add_argument("--only", nargs="*", default=[], metavar="NAME", help="only these recordings")
    compares = commands.add_parser("compare", help="list the differences")
    compares.add_argument("before", type=Path)
    compares.add_argument("after", type=Path)
    compares.add_argument("--renamed", nargs="*", default=[], metavar="OLD=NEW", help="further keys that were renamed")
    a = parser.parse_args(given)
    if a.command == "record":
        print(f"{len(record(a.dir, a.only))} recordings in {a.dir}")
        return 0
    if a.command == "identify":
        print(f"{identify(a.dir, a.out, a.processes, a.only)} results in {a.out}")
        return 0
    renamed = {**RENAMED, **dict(pair.split("=", 1) for pair in a.renamed)}
    both, lines = compare(a.before, a.after, renamed)
    print("\n".join([*lines, f"{len(lines)} differences in {both} results"]))
    return 1 if lines or not both else 0


if __name__ == "__main__":
    sys.exit(main())
