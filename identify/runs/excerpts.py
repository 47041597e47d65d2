"""What was used of recordings that are too long to be identified sample by sample."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rig.recording.run import Run


def describe_excerpts(runs: Sequence[Run], say: Callable[[str], None]) -> tuple[str, ...]:
    """What was used and what was not, in words, and said; empty where all runs are used as they were recorded."""
    each = [_describe(run) for run in runs if run.excerpt is not None]
    if not each:
        return ()
    sentence = f"Long recordings are used in part: {'; '.join(each)}. Raise recorded.most_samples to use more"
    say(sentence)
    return (sentence,)


def _describe(run: Run) -> str:
    taken = run.excerpt
    assert taken is not None
    count = f"{taken.samples:,}".replace(",", " ")
    if taken.whole:
        what = f"all of its {count} samples"
    else:
        what = f"{taken.begin_s:.6g} to {taken.end_s:.6g} s of {count} samples, the most informative span"
    how = f", low-passed and every {_ordinal(taken.factor)} kept" if taken.factor > 1 else ""
    return f"{run.name}: {what}{how}"


def _ordinal(n: int) -> str:
    ending = "th" if n % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(n % 10, "th")
    return f"{n}{ending}"
