"""Scores as tables."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Sequence

from benchmarks.blind.library import INSEPARABLE
from benchmarks.blind.score import LIMITS_PERCENT, Score

Pick = Callable[[Score], bool]
ALLOWED_SIGMA = 1.1


def _share(scores: Iterable[Score], of: Pick, good: Pick) -> str:
    group = [s for s in scores if of(s)]
    hits = sum(good(s) for s in group)
    return f"{100.0 * hits / len(group):.1f} % ({hits} of {len(group)})" if group else "none"


def _single(sizes: Sequence[float]) -> Pick:
    return lambda s: s.kind == "single" and s.detectable and not s.nothing_to_name and s.size in sizes


def _right(s: Score) -> bool:
    """All of the truth named and nothing besides."""
    return bool(s.exact)


def _close(s: Score) -> bool:
    return all(e is not None and abs(e) <= m for e, m in zip(s.errors_percent, LIMITS_PERCENT, strict=True))


def _quiet(s: Score) -> bool:
    return s.residual is not None and s.residual <= ALLOWED_SIGMA


def _named(s: Score) -> bool:
    return bool(s.named) and s.kind in {"single", "pair"} and s.detectable


def _known(s: Score) -> bool:
    """Cases whose model is the truth's, so that J, C, K have a meaning."""
    return s.nothing_to_name or _right(s)


def rows(scores: Sequence[Score]) -> list[tuple[str, str, str]]:
    """What is measured, what is asked, what was found."""
    covered = [c for s in scores if _known(s) for c in s.covered if c is not None]
    inside = f"{100.0 * sum(covered) / len(covered):.1f} % ({sum(covered)} of {len(covered)})" if covered else "none"
    times = [s.seconds for s in scores]
    cpu = [s.cpu_seconds for s in scores]
    outside: Pick = lambda s: s.kind == "outside" and s.detectable  # noqa: E731
    pair: Pick = lambda s: s.kind == "pair" and s.detectable  # noqa: E731
    every: Pick = lambda s: (s.kind in {"single", "pair"} and s.detectable) or s.nothing_to_name  # noqa: E731
    return [
        ("right name first, 1 and 5 %", "98 %", _share(scores, _single((0.01, 0.05)), lambda s: bool(s.first))),
        ("right name first, 0.3 %", "90 %", _share(scores, _single((0.003,)), lambda s: bool(s.first))),
        ("... and nothing named besides, all sizes", "", _share(scores, _single((0.003, 0.01, 0.05)), _right)),
        ("both of a pair and none besides", "90 %", _share(scores, pair, _right)),
        ("clean, torque scale, bias: anything named", "at most 1 %",
         _share(scores, lambda s: s.nothing_to_name, lambda s: bool(s.named))),
        ("outside the library: unexplained, nothing named", "95 %",
         _share(scores, outside, lambda s: not s.named and bool(s.unexplained))),
        ("inseparable pair declared", "100 %",
         _share(scores, lambda s: s.declared is not None, lambda s: bool(s.declared))),
        ("free-run residual at most 1.1 of the noise (as the tool says), of named", "95 %",
         _share(scores, _named, _quiet)),
        ("the same, the tool's model run by the bench", "95 %",
         _share(scores, lambda s: _named(s) and s.replayed is not None,
                lambda s: (s.replayed or 9.0) <= ALLOWED_SIGMA)),
        ("J, C, K within 0.1, 1, 0.1 %", "95 %", _share(scores, every, _close)),
        ("J, C, K within 0.1, 1, 0.1 %, where rightly named", "", _share(scores, _known, _close)),
        ("their 95 % intervals cover, where rightly named", "93-97 %", inside),
        ("seconds a case, median (processor seconds)", "10 s",
         f"{statistics.median(times):.1f} ({statistics.median(cpu):.1f})" if times else "none"),
        ("left out as undetectable", "", str(sum(not s.detectable for s in scores))),
        ("exit code neither 0 nor 1", "0", str(sum(s.exit_code not in (0, 1) for s in scores))),
    ]  # fmt: skip


def _resolved(s: Score) -> bool:
    """Rightly named, and no rival left but those that no record of torque and rate ever parts."""
    never = {r for e in s.truth for r in INSEPARABLE.get(e, ())} | set(s.truth)
    return _right(s) and set(s.rivals) <= never


def table(scores: Sequence[Score], title: str, followed: Sequence[tuple[Score, Score]] = ()) -> str:
    """The table of the bench; ``followed`` are cases before and after the follow-up that the tool asked for."""
    given = rows(scores)
    if followed:
        open_ = [after for before, after in followed if not _resolved(before) and after.kind in {"single", "pair"}]
        given.append(("resolved after the follow-up", "95 %", _share(open_, lambda s: True, _resolved)))
    body = "".join(f"| {what} | {asked} | {found} |\n" for what, asked, found in given)
    return f"Blind bench, {title}\n\n| measured | asked | found |\n|---|---|---|\n{body}"


def _number(x: float | None, digits: int = 3) -> str:
    return "-" if x is None else f"{x:.{digits}g}"


def listing(scores: Sequence[Score]) -> str:
    """One line a case, the failures first."""
    head = (
        "| case | truth | size % | noise deg/s | campaign | named (rivals) | wrong | J, C, K off by % | covered | "
        "residual | replayed | s |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    )
    lines = []
    for s in sorted(scores, key=lambda s: (not s.wrong, s.wrong, s.number)):
        rivals = f" ({', '.join(s.rivals)})" if s.rivals else ""
        undetectable = "" if s.detectable else " [undetectable]"
        wrong = s.wrong or ("" if not s.unexplained or s.kind == "outside" else "right, but unexplained")
        lines.append(
            f"| {s.number} | {' + '.join(s.truth) or s.kind}{undetectable} | {100 * s.size if s.truth else 0:g} | "
            f"{s.noise_deg_s:.2g} | {s.campaign} | {' + '.join(s.named) or '-'}{rivals} | {wrong} | "
            f"{', '.join(_number(e, 2) for e in s.errors_percent)} | "
            f"{''.join('?' if c is None else 'y' if c else 'n' for c in s.covered)} | {_number(s.residual)} | "
            f"{_number(s.replayed)} | {s.seconds:.1f} |\n"
        )
    return head + "".join(lines)
