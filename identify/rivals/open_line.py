"""A steady line of which nobody can say whether a torque or the sensor makes it: not named, but not forgotten either.

The numbers of the others, and what is left, stay as they are beside it. At its own frequency a torque does to the
reading of a platform in steady motion what a line of the sensor does; without either, the line would be taken for
inertia and damping.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identify.estimate.final_fit import FinalFit, free_run_of
from identify.rivals.tone_origin import TONE, describe, standing_line
from identify.select.search_state import Found
from identify.select.stepwise import Stepwise
from identify.signals.trace import Trace


def with_line_left_open(
    found: Found, search: Stepwise, traces: Sequence[Trace], everything: Sequence[Any], axis: str,
    say: Callable[[str], None], judged: Callable[[Found], Found],
) -> Found:  # fmt: skip
    """The same without a periodic disturbance that may be a line of the gyro's own, the other names ``judged``.

    They are judged by what is left beside the line: that nobody knows where it comes from does not speak against them.
    An encoder has no line of its own, but the torque of a run may differ from the recorded one under any sensor.
    """
    line = standing_line(found.after, traces) if TONE in found.named else None
    gyro = all(t.channel == "rate" and t.beside is None for t in traces)
    if line is None or not (gyro or line.of_torque):
        return judged(found)
    where = "the recorded torque of one run" if line.of_torque else "the sensor itself"
    say(f"not named: {TONE}; the line may come from {where}")
    bare = search.without(search.best, TONE) if TONE in search.best.structure.effects else search.best
    less = replace(found.without(TONE), disturbance=found.disturbance)
    if less.named:
        less = replace(less, after=with_numbers_of(found.after, less.after, traces, everything))
    less.search.mark_undetermined(TONE, describe(line, axis, traces[0].channel), less.kept)
    return judged(less).with_lines(bare, search.problem.torque_nm)


def with_numbers_of(richer: FinalFit, less: FinalFit, traces: Sequence[Trace], use: Sequence[Any]) -> FinalFit:
    """A model with the numbers, and their uncertainty, that it has as a part of another."""
    at = [richer.names.index(n) for n in less.names if n in richer.names]
    values = {n: richer.values.get(n, value) for n, value in less.values.items()}
    return replace(
        less, values=values, names=tuple(richer.names[i] for i in at), covariance=richer.covariance[np.ix_(at, at)],
        determined=tuple(richer.determined[i] for i in at),
        free_run=free_run_of(traces, less.structure, values, use),
    )  # fmt: skip
