"""Runs whose sensor counts its angle anew after every turn, and what was made of that."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rig.recording.run import Run


def describe_turns(runs: Sequence[Run], say: Callable[[str], None]) -> tuple[str, ...]:
    """In which runs the angle was made to go on over whole turns, in words, and said; empty where in none."""
    each = [f"{run.name} ({_times(run.wraps)})" for run in runs if run.wraps]
    if not each:
        return ()
    sentence = (
        "The angle begins anew after a whole turn and was made to go on, all runs counted from the same zero: "
        + ", ".join(each)
    )
    say(sentence)
    return (sentence,)


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
