"""The small benchmarks again, their ratios held against those kept: 20 % worse is a failure. A job for CI.

pip install -e '.[peers]'
python -m benchmarks.compare                 # all of them
python -m benchmarks.compare genetic

Ratios are measured within one run, so that a slower machine changes both of their sides. A ratio that looks worse is
measured twice more, and the best counts: a neighbour on the machine may have had one run, not three.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path

from benchmarks.kept import KEPT, Result, file_of

BENCHMARKS = ("genetic", "estimation", "growth")
WORSE = 0.8  # of the ratio that is kept
AGAIN = 2


def compared(kept: Mapping[str, float], measure: Callable[[], Mapping[str, float]]) -> dict[str, tuple[float, float]]:
    """Kept ratio and the best one now, by name; measured again while one is worse."""
    best = dict(measure())
    for _ in range(AGAIN):
        if not worse(kept, best):
            break
        again = measure()
        best = {name: max(best.get(name, 0.0), again.get(name, 0.0)) for name in {*best, *again}}
    return {name: (value, best.get(name, 0.0)) for name, value in kept.items()}


def worse(kept: Mapping[str, float], now: Mapping[str, float]) -> list[str]:
    """The ratios that are too much worse, or no longer there."""
    return [name for name, value in kept.items() if now.get(name, 0.0) < WORSE * value]


def main() -> None:
    """Print every ratio beside the kept one; exit code 1 where one is worse."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(BENCHMARKS)}; all if left out")
    parser.add_argument("--kept", type=Path, default=KEPT, help="folder of the results to compare with")
    given = parser.parse_args()
    unknown = [name for name in given.names if name not in BENCHMARKS]
    if unknown:
        parser.error(f"{unknown[0]!r} is not one of {', '.join(BENCHMARKS)}")
    failed = False
    print("| benchmark | ratio | kept | now | |\n|---|---|---|---|---|")
    for name in given.names or BENCHMARKS:
        kept = json.loads(file_of(given.kept, name, True).read_text(encoding="utf-8"))["ratios"]
        result_of: Callable[[bool], Result] = import_module(f"benchmarks.{name}").result_of
        for ratio, (before, now) in compared(kept, lambda measure=result_of: measure(True).ratios).items():
            bad = now < WORSE * before
            failed = failed or bad
            print(f"| {name} | {ratio} | {before:.3g} | {now:.3g} | {'WORSE' if bad else ''} |", flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
