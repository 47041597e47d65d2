"""What was made of recordings as they were read: rows without a value, angles within a turn, long ones cut."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from identify.runs.excerpts import describe_excerpts
from identify.wording import joined
from rig.recording.run import Missing, Run


def describe_reading(runs: Sequence[Run], say: Callable[[str], None]) -> tuple[str, ...]:
    """All of it in words, and said; empty where the runs are used as they were recorded."""
    tellers = (describe_excerpts, describe_turns, describe_missing, describe_notes)
    return tuple(s for tell in tellers for s in tell(runs, say))


def describe_turns(runs: Sequence[Run], say: Callable[[str], None]) -> tuple[str, ...]:
    """In which runs the angle was made to go on over whole turns, in words, and said; empty where in none."""
    each = [f"{run.name} ({_times(run.wraps)})" for run in runs if run.wraps]
    if not each:
        return ()
    sentence = (
        "The angle starts again at zero after a whole turn and was unwrapped, all runs counted from the same zero: "
        + ", ".join(each)
    )
    say(sentence)
    return (sentence,)


def describe_missing(runs: Sequence[Run], say: Callable[[str], None]) -> tuple[str, ...]:
    """Which rows were left out for want of a value, in words, and said; empty where none was."""
    left = [f"{run.name} ({_rows(run.missing)})" for run in runs if run.missing and run.missing.quantities]
    laid = [f"{run.name} ({joined(run.missing.between)})" for run in runs if run.missing and run.missing.between]
    said = []
    if left:
        said.append(f"Rows in which a column has no value are left out: {', '.join(left)}")
    if laid:
        said.append(
            "Columns with rows of their own are read at the times of the slowest, the others interpolated linearly: "
            f"{', '.join(laid)}"
        )
    for sentence in said:
        say(sentence)
    return tuple(said)


def describe_notes(runs: Sequence[Run], say: Callable[[str], None]) -> tuple[str, ...]:
    """What the readers noted of their files, one sentence a note, and said; empty where they noted nothing."""
    of: dict[str, list[str]] = {}
    for run in runs:
        for note in run.notes:
            of.setdefault(note, []).append(run.name)
    said = tuple(f"Of {joined(names)}, {note}" for note, names in of.items())
    for sentence in said:
        say(sentence)
    return said


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _rows(found: Missing) -> str:
    places = ((found.before, "at the beginning"), (found.within, "within"), (found.after, "at the end"))
    instead = f"; the file has {joined(found.instead)}" if found.instead else ""
    return f"{joined([f'{n} {where}' for n, where in places if n])}, no {' or '.join(found.quantities)}{instead}"
