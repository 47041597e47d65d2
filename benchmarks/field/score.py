"""What the tool said of a field case, against the truth: `python -m benchmarks.field.score DIR` prints the tables."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[2])  # this folder's names must not hide those of libraries

from benchmarks.field.library import LATE, LIBRARY, PART_OF

NAMES = ("inertia", "damping", "stiffness")
LIMITS_PERCENT = (2.0, 10.0, 2.0)  # a number further off must not pass as accepted
# A drive that gives less torque than it says: what it gave at first is nobody's to know, so J, C, K have no truth.
GAINS = frozenset({"warming_gain", "sagging_gain"})
NUISANCES = frozenset({"rate_bias"})

Numbers = tuple[float | None, ...]


@dataclass(frozen=True)
class Score:
    """One case. ``None`` where a question does not apply or nothing was said. J, C, K in this order."""

    number: int
    kind: str
    hidden: tuple[str, ...]
    samples: int
    named: tuple[str, ...]
    declared_beside: tuple[str, ...]  # names that the verdict says it cannot tell from those
    missing: tuple[str, ...]  # hidden, and neither named nor declared beside a name that this record does not part
    wrong: tuple[str, ...]  # named, and neither hidden nor allowed
    accepted: bool | None
    unexplained: bool | None
    errors_percent: Numbers
    in_bounds: Numbers  # errors over the Cramer-Rao bound
    oracle_in_bounds: Numbers  # the same of one who knows the structure
    covered: tuple[bool | None, ...]
    spring_invented: bool  # a stiffness beyond its interval where there is no spring
    seconds: float
    cpu_seconds: float
    peak_mib: float
    exit_code: int

    @property
    def right(self) -> bool:
        """All of the truth named, and nothing besides."""
        return self.exit_code in (0, 1) and not self.missing and not self.wrong

    @property
    def far_off(self) -> bool:
        """Whether J, C or K is further off than what may pass."""
        if GAINS & set(self.hidden):
            return False
        return any(e is not None and abs(e) > m for e, m in zip(self.errors_percent, LIMITS_PERCENT, strict=True))

    @property
    def fault(self) -> str:
        """What went wrong, in a word; empty where nothing did."""
        if self.exit_code not in (0, 1):
            return "no end" if self.exit_code == -1 else f"exit {self.exit_code}"
        if self.accepted and self.far_off:
            return "wrong number accepted"
        if self.kind == "outside":
            return "outside: named" if self.wrong else ("" if self.unexplained else "outside: not unexplained")
        if self.kind == "nothing":
            return "false alarm" if self.wrong else ("" if self.accepted else "not accepted")
        if not self.right:
            return "nothing named" if not self.named else ("more besides" if not self.missing else "wrong names")
        return "" if self.accepted else "not accepted"


def score(truth: Mapping[str, Any], result: Mapping[str, Any] | None, ran: Mapping[str, Any]) -> Score:
    """Score one result.json (None where there is none)."""
    hidden = tuple(truth["effects"])
    none: Numbers = (None,) * 3
    empty = Score(
        truth["number"], truth["kind"], hidden, truth["samples"], (), (), hidden, (), None, None, none, none, none,
        (None,) * 3, False, ran["seconds"], ran["cpu_seconds"], ran["peak_mib"], ran["exit_code"],
    )  # fmt: skip
    if result is None:
        return empty
    verdict = result["verdict"]
    named = tuple(n for n in verdict["effects"] if n not in NUISANCES)
    beside = _beside(verdict, named)
    missing, wrong = judged(truth, named, beside)
    final = result["after"] or result["before"]
    errors, within, covered = _parameters(truth, final["parameters"])
    invented = False
    if not truth["rig"]["stiffness"] and "stiffness" in final["parameters"]:
        low, high = final["parameters"]["stiffness"]["ci95"]
        invented = not low <= 0.0 <= high
    return replace(
        empty, named=named, declared_beside=tuple(sorted(beside)), missing=missing, wrong=wrong,
        accepted=result["accepted"], unexplained=verdict["unexplained"], errors_percent=errors, in_bounds=within,
        oracle_in_bounds=_oracle(truth), covered=covered, spring_invented=invented,
    )  # fmt: skip


def judged(truth: Mapping[str, Any], named: Sequence[str], beside: set[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Effects that are missing, and names that are wrong.

    A name that stands for a hidden effect which this record does not part from it counts where the hidden one is
    declared beside it. Outside the library nothing can be missing but what the library holds.
    """
    evidence = truth["evidence"]
    hidden = [n for n in truth["effects"] if n in LIBRARY]
    fine = set(hidden) | set(evidence["allowed"])
    for name in truth["effects"]:
        fine |= PART_OF.get(name, frozenset())
    missing = []
    for name in hidden:
        if name in named:
            continue
        stands_in = set(evidence["alike"].get(name, ())) & set(named)
        if stands_in and name in beside:
            fine |= stands_in
        else:
            missing.append(name)
    if set(hidden) & LATE:  # two of them are as true as one, where the record does not part them
        fine |= {a for n in hidden if n in LATE for a in evidence["alike"].get(n, ()) if n in named}
    return tuple(missing), tuple(n for n in named if n not in fine)


def _beside(verdict: Mapping[str, Any], named: Sequence[str]) -> set[str]:
    """Every effect that the verdict names beside those that it lists."""
    out = {x for name in named for x in verdict["confusable_with"].get(name, ())}
    for pair in verdict.get("never_separable", {}):
        out |= {x.strip() for x in pair.split("/")}
    return out - set(named)


def _parameters(truth: Mapping[str, Any], found: Mapping[str, Any]) -> tuple[Numbers, Numbers, tuple[bool | None, ...]]:
    """Errors in percent, errors over the bound (where it is sound), and whether the interval covers."""
    rows: list[tuple[float | None, float | None, bool | None]] = []
    for name in NAMES:
        true = truth["rig"][name]
        if not true or name not in found:
            rows.append((None, None, None))
            continue
        low, high = found[name]["ci95"]
        off = found[name]["value"] - true
        sound = not truth["evidence"]["bound_unsound"]
        rows.append(
            (100.0 * off / true, off / truth["evidence"]["bound"][name] if sound else None, low <= true <= high)
        )
    errors, within, covered = zip(*rows, strict=True)
    return errors, within, covered


def _oracle(truth: Mapping[str, Any]) -> Numbers:
    evidence = truth["evidence"]
    if evidence["bound_unsound"]:
        return (None,) * 3
    return tuple(evidence["oracle"][n] / evidence["bound"][n] if n in evidence["bound"] else None for n in NAMES)


def scores(out: Path) -> list[Score]:
    """Scores of every case of a bench that was run."""
    found = []
    for record in sorted((out / "results").glob("*.run.json")):
        number = record.name.partition(".")[0]
        result = out / "results" / number / "result.json"
        found.append(
            score(
                json.loads((out / "truth" / f"{number}.json").read_text(encoding="utf-8")),
                json.loads(result.read_text(encoding="utf-8")) if result.exists() else None,
                json.loads(record.read_text(encoding="utf-8")),
            )
        )
    return found


def main() -> None:
    """Command line."""
    from benchmarks.field.tables import listing, table  # noqa: PLC0415 (it needs Score)

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="DIR")
    a = parser.parse_args()
    found = scores(a.out)
    if not found:
        sys.exit(f"{a.out / 'results'}: nothing was run yet")
    text = table(found) + "\n" + listing(found)
    (a.out / "table.md").write_text(text, encoding="utf-8")
    (a.out / "scores.json").write_text(json.dumps([asdict(s) for s in found], indent=1) + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
