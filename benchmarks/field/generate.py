"""Draw field cases: `python -m benchmarks.field.generate DIR --cases N --seed S`.

DIR/cases/NNNN holds what the tool may read, DIR/truth/NNNN.json what it may not. Cases that stand there are left alone.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[2])  # this folder's names must not hide those of libraries

from benchmarks.field.cases import KINDS, make, orders
from benchmarks.field.files import write_case
from benchmarks.field.library import EVERYTHING
from benchmarks.field.rigs import Unsuitable


def generate(
    out: Path, seed: int, count: int, kinds: Sequence[str] = (), effects: Sequence[str] = (), only: Sequence[int] = ()
) -> list[int]:
    """Write the cases that are not there yet. Returns the numbers for which no rig showed what was ordered."""
    failed = []
    for number, order in orders(seed, count, kinds, effects):
        truth = out / "truth" / f"{number:04d}.json"
        if truth.exists() or (only and number not in only):
            continue
        begin = time.monotonic()
        try:
            case = make(seed, number, order)
        except Unsuitable as error:
            print(error, file=sys.stderr, flush=True)
            failed.append(number)
            continue
        write_case(case, out / "cases" / f"{number:04d}", truth)
        said = f"{order.kind} {'+'.join(order.effects)}, {sum(len(m.torque) for m in case.measured)} samples"
        print(f"{number:4d} {time.monotonic() - begin:5.1f} s  {said}", file=sys.stderr, flush=True)
    return failed


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="DIR")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--kinds", nargs="*", default=[], choices=KINDS, help="only cases of these kinds")
    parser.add_argument("--effects", nargs="*", default=[], choices=sorted(EVERYTHING), help="only with one of these")
    parser.add_argument("--only", nargs="*", type=int, default=[], help="only the cases of these numbers")
    a = parser.parse_args()
    failed = generate(a.out, a.seed, a.cases, a.kinds, a.effects, a.only)
    if failed:
        print(f"not made: {', '.join(map(str, failed))}", file=sys.stderr)


if __name__ == "__main__":
    main()
