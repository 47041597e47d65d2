"""Scores of field cases as tables."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence

from benchmarks.field.score import Score

Pick = Callable[[Score], bool]


def _share(scores: Sequence[Score], of: Pick, good: Pick) -> str:
    group = [s for s in scores if of(s)]
    hits = sum(good(s) for s in group)
    return f"{100.0 * hits / len(group):.1f} % ({hits} of {len(group)})" if group else "none"


def _kind(kind: str) -> Pick:
    return lambda s: s.kind == kind


def _known(s: Score) -> bool:
    """The final model is the truth's, so that J, C, K have a bound."""
    return s.kind != "outside" and s.right


def _rms(values: Sequence[float]) -> str:
    if not values:
        return "none"
    rms = math.sqrt(sum(v * v for v in values) / len(values))
    middle = statistics.median(abs(v) for v in values)
    within = sum(abs(v) < 3.0 for v in values)
    return f"{rms:.2f} (median {middle:.2f}, {within} of {len(values)} numbers within 3)"


def _spread(values: Sequence[float], digits: int) -> str:
    return f"{statistics.median(values):.{digits}f} / {max(values):.{digits}f}" if values else "none"


def rows(scores: Sequence[Score]) -> list[tuple[str, str, str]]:
    """What is measured, what is asked, what was found."""
    covered = [c for s in scores if _known(s) for c in s.covered if c is not None]
    bounds = [
        (b, o) for s in scores if _known(s)
        for b, o in zip(s.in_bounds, s.oracle_in_bounds, strict=True) if b is not None and o is not None
    ]  # fmt: skip
    ended = [s for s in scores if s.exit_code in (0, 1)]
    return [
        ("right names and nothing besides, singles", "95 %", _share(scores, _kind("single"), lambda s: s.right)),
        ("the same, pairs", "90 %", _share(scores, _kind("pair"), lambda s: s.right)),
        ("the same, triples", "", _share(scores, _kind("triple"), lambda s: s.right)),
        ("nothing there: anything named", "at most 1 %", _share(scores, _kind("nothing"), lambda s: bool(s.wrong))),
        ("outside the library: unexplained, no wrong effect", "95 %",
         _share(scores, _kind("outside"), lambda s: bool(s.unexplained) and not s.wrong)),
        ("accepted where all that is there is named", "95 %", _share(scores, _known, lambda s: bool(s.accepted))),
        ("not accepted where J, C or K is off by more than 2, 10, 2 %", "98 %",
         _share(scores, lambda s: s.far_off, lambda s: not s.accepted)),
        ("rms error of J, C, K over the Cramer-Rao bound, where rightly named", "1.2", _rms([b for b, _ in bounds])),
        ("... of the oracle, same records", "", _rms([o for _, o in bounds])),
        ("their 95 % intervals cover, where rightly named", "93-97 %",
         f"{100.0 * sum(covered) / len(covered):.1f} % ({sum(covered)} of {len(covered)})" if covered else "none"),
        ("no spring there: a stiffness beyond its interval", "0", str(sum(s.spring_invented for s in scores))),
        ("seconds, median / worst", "15 / 60", _spread([s.seconds for s in scores], 1)),
        ("... processor seconds", "", _spread([s.cpu_seconds for s in scores], 1)),
        ("... above 30,000 samples", "", _spread([s.seconds for s in scores if s.samples > 30_000], 1)),
        ("peak memory, MiB, median / worst", "1024 at 200,000 samples", _spread([s.peak_mib for s in scores], 0)),
        ("neither accepted nor refused: stopped at the limit, or an exit code above 1", "0",
         str(len(scores) - len(ended))),
    ]  # fmt: skip


def table(scores: Sequence[Score]) -> str:
    """The table of the bench."""
    body = "".join(f"| {what} | {asked} | {found} |\n" for what, asked, found in rows(scores))
    return f"Field bench, {len(scores)} cases\n\n| measured | asked | found |\n|---|---|---|\n{body}"


def _number(x: float | None) -> str:
    return "-" if x is None else f"{x:.2g}"


def listing(scores: Sequence[Score]) -> str:
    """One line a case, the failures first."""
    head = (
        "| case | kind | samples | hidden | named (beside) | fault | accepted | J, C, K off by % | over the bound | "
        "covered | s |\n|---|---|---|---|---|---|---|---|---|---|---|\n"
    )
    lines = []
    for s in sorted(scores, key=lambda s: (not s.fault, s.fault, s.number)):
        hidden, named = " + ".join(s.hidden) or "-", " + ".join(s.named) or "-"
        beside = f" ({', '.join(s.declared_beside)})" if s.declared_beside else ""
        accepted = "-" if s.accepted is None else ("yes" if s.accepted else "no")
        lines.append(
            f"| {s.number} | {s.kind} | {s.samples} | {hidden} | "
            f"{named}{beside} | {s.fault} | {accepted}{', unexplained' if s.unexplained else ''} | "
            f"{', '.join(map(_number, s.errors_percent))} | {', '.join(map(_number, s.in_bounds))} | "
            f"{''.join('?' if c is None else 'y' if c else 'n' for c in s.covered)} | {s.seconds:.1f} |\n"
        )
    return head + "".join(lines)
