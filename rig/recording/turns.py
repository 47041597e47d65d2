"""An angle that begins anew after every turn, made one that goes on; one that jumps by no whole turn, refused.

Within a turn a sensor says where the platform is, not how often it has gone round. As long as the platform turns by
less than a quarter of a turn from sample to sample, the missing turn is known: it is the one that leaves the motion as
slow as it is before and after.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rig.arrays import Array, Mask
from rig.errors import RecordingError
from rig.recording.run import Run
from rig.units import TURN

NEAR_TURN = 0.05  # of a turn: a jump that differs more from a whole turn, the motion aside, is none
SLOW_STEP_RAD = TURN / 4  # from sample to sample, nearly always: four samples a turn
NEARLY_ALWAYS = 0.9  # of the steps
NEIGHBOUR_STEPS = 7  # steps about one that tell the motion there
# Times the usual spacing: samples that stand farther apart have lost more than one between them.
LOST_SPACING_RATIO = 2.5
JUMP_RATIO = 4.0  # times the largest step that the run makes elsewhere: no inertia lets a rate come and go like that
MOST_TOLD = 3  # jumps that a message names
JUMP_SIGMAS = 30.0  # times the noise
MEDIAN_SIGMAS = 0.6745  # of the size of a normal variable, in standard deviations


def on_the_way(time_s: Array, angle_rad: Array, good: Any) -> Mask:
    """Samples between two readings a whole turn apart: an analogue output on its way back to zero, shape (n,).

    Parameters
    ----------
    time_s, angle_rad, good
        As for ``turns_missing``.
    """
    out = np.zeros(len(angle_rad), dtype=bool)
    at = np.flatnonzero(good)
    if len(at) <= NEIGHBOUR_STEPS or not np.all(np.diff(time_s[at]) > 0.0):
        return out
    step, spacing = np.diff(angle_rad[at]), np.diff(time_s[at])
    within = _within_half_a_turn(step)
    if float(np.quantile(np.abs(within), NEARLY_ALWAYS)) >= SLOW_STEP_RAD:
        return out
    off = step - spacing * _running_median(within / spacing)
    far = np.abs(_within_half_a_turn(off)) > NEAR_TURN * TURN
    both = off[1:] + off[:-1]
    turned = (np.rint(both / TURN) != 0.0) & (np.abs(_within_half_a_turn(both)) < NEAR_TURN * TURN)
    together = spacing[1:] + spacing[:-1] < LOST_SPACING_RATIO * np.median(spacing)
    out[at[1:-1]] = far[1:] & far[:-1] & turned & together
    return out


def turns_missing(time_s: Array, angle_rad: Array, good: Any) -> Array:
    """How many whole turns have to be added to every sample so that the angle goes on, shape (n,), 0 at the first.

    Parameters
    ----------
    time_s, angle_rad
        Shape (n,).
    good
        Shape (n,), boolean: samples that are there; others go with the one before.

    All zero where the angle never jumps by a whole turn, or moves too fast for that to be told.
    """
    out = np.zeros(len(angle_rad))
    at = np.flatnonzero(good)
    if len(at) <= NEIGHBOUR_STEPS:
        return out
    spacing, step = np.diff(time_s[at]), np.diff(angle_rad[at])
    if not np.all(spacing > 0.0):
        return out  # the check of the times says so
    within = _within_half_a_turn(step)
    if float(np.quantile(np.abs(within), NEARLY_ALWAYS)) >= SLOW_STEP_RAD:
        return out
    foretold = spacing * _running_median(within / spacing)
    turns = -np.rint((step - foretold) / TURN)
    together = spacing < LOST_SPACING_RATIO * np.median(spacing)
    near = np.abs(step + TURN * turns - foretold) < NEAR_TURN * TURN
    sure = together & near & (turns != 0.0)
    if not np.any(sure):
        return out  # over a hole alone nobody knows how far the platform turned
    added = np.where(sure | ~together, turns, 0.0)
    out[at[1:]] = added
    return np.cumsum(out)


@dataclass(frozen=True)
class Turns:
    """Where in a file of many rows the angle begins anew: ``rows``, shape (k,), and whole turns to add from each on.

    ``passing`` are rows between two that lie a turn apart, shape (m,).
    """

    rows: Array
    turns: Array
    passing: Array

    def added(self, first: int, last: int) -> Array:
        """Radians to add to rows first..last (excluded), shape (n,)."""
        behind = np.searchsorted(self.rows, np.arange(first, last), side="right")
        return TURN * np.concatenate([[0.0], self.turns])[behind]


def turns_along(rows: Callable[[int, int], Mapping[str, Array]], first: int, last: int, block: int) -> Turns:
    """As ``turns_missing``, of rows first..last (excluded), ``block`` of them at a time.

    Parameters
    ----------
    rows
        Gives "time", "angle" and "valid" of some rows, each of shape (n,).
    """
    where, added, passing = [], [], []
    lead = 2 * NEIGHBOUR_STEPS  # rows that a block shares with the one before and the one behind
    for at in range(first, last, block):
        begin, end = max(first, at - lead), min(last, at + block + lead)
        columns = rows(begin, end)
        good = columns["valid"].astype(bool) & np.isfinite(columns["time"]) & np.isfinite(columns["angle"])
        between = on_the_way(columns["time"], columns["angle"], good)
        missing = np.diff(turns_missing(columns["time"], columns["angle"], good & ~between), prepend=0.0)
        on_way = begin + np.flatnonzero(between)
        passing.append(on_way[(on_way >= at) & (on_way < at + block)])
        own = begin + np.flatnonzero(missing)
        inside = (own >= at) & (own < at + block)
        where.append(own[inside])
        added.append(missing[own[inside] - begin])
    return Turns(np.concatenate(where), np.cumsum(np.concatenate(added)), np.concatenate(passing))


def unwrapped(run: Run, path: Path) -> Run:
    """The run with an angle that goes on over whole turns, and how often it had begun anew.

    Raises RecordingError for an angle within one turn that moves too far between samples to be unwrapped.
    """
    if run.angle_rad is None or len(run.angle_rad) != len(run.time_s):
        return run
    good = run.valid & np.isfinite(run.angle_rad)
    _check_turns(path, run.time_s, run.angle_rad, good)
    passing = on_the_way(run.time_s, run.angle_rad, good)
    turns = turns_missing(run.time_s, run.angle_rad, good & ~passing)
    wraps = int(np.count_nonzero(np.diff(turns)))
    if not wraps:
        return run
    return replace(run, angle_rad=run.angle_rad + TURN * turns, valid=run.valid & ~passing, wraps=wraps)


def on_one_turn(runs: Sequence[Run]) -> list[Run]:
    """Runs of one sensor that begins anew after a turn, all counted from the same zero.

    Which whole turn a run was in nobody recorded: the first is put within half a turn of zero, the others as near to it
    as can be. Runs of a sensor that never began anew stay as they are.
    """
    if not any(run.wraps for run in runs):
        return list(runs)
    out, near = [], 0.0
    for run in runs:
        if run.angle_rad is None:
            out.append(run)
            continue
        middle = float(np.median(run.angle_rad[run.valid & np.isfinite(run.angle_rad)]))
        turns = np.rint((middle - near) / TURN)
        near = middle - TURN * turns
        out.append(replace(run, angle_rad=run.angle_rad - TURN * turns))
    return out


def check_jumps(run: Run, path: Path, axis: Literal["rotary", "linear"]) -> None:
    """Raise RecordingError where the angle jumps between two samples and stays there.

    A sample that stands apart alone is none of this: it is left out later.
    """
    if run.angle_rad is None:
        return
    at = np.flatnonzero(run.valid & np.isfinite(run.angle_rad))
    time_s, angle = run.time_s[at], run.angle_rad[at]
    found = _jumps(time_s, angle)
    if not found:
        return
    unit = "rad" if axis == "rotary" else "m"
    what = "the angle" if axis == "rotary" else "the position"
    where = ", ".join(f"by {angle[j] - angle[i]:.4g} {unit} at {time_s[j]:.6g} s" for i, j in found[:MOST_TOLD])
    if len(found) > MOST_TOLD:
        where += f" and {len(found) - MOST_TOLD} times more"
    no_turn = ", which is no whole turn" if axis == "rotary" else ""
    ratio = f"more than {JUMP_RATIO:g} times as far as in any other step"
    before, behind = found[0]
    split = f"to_s: {time_s[before]:.9g} and a second run of the same file with from_s: {time_s[behind]:.9g}"
    scale = "; where the sensor begins anew after a turn there, correct recorded.scale.angle" if no_turn else ""
    raise RecordingError(
        f"{path}: {what} jumps {where}{no_turn} and {ratio}: "
        f"split the run there ({split}), or leave the angle out where there is a rate{scale}"
    )


def _check_turns(path: Path, time_s: Array, angle_rad: Array, good: Any) -> None:
    """Raise RecordingError for an angle within one turn that moves too far between samples to be unwrapped."""
    at = np.flatnonzero(good)
    step = np.diff(angle_rad[at])
    if len(step) <= NEIGHBOUR_STEPS or np.ptp(angle_rad[at]) > (1.0 + NEAR_TURN) * TURN:
        return
    within = float(np.quantile(np.abs(_within_half_a_turn(step)), NEARLY_ALWAYS))
    largest = int(np.argmax(np.abs(step)))
    if within < SLOW_STEP_RAD or abs(step[largest]) < TURN / 2:
        return
    raise RecordingError(
        f"{path}: the angle stays within one turn and changes by up to {abs(step[largest]):.4g} rad from one sample to "
        f"the next (at {time_s[at[largest + 1]]:.6g} s): where it begins anew after each turn cannot be told, as that "
        "needs at least four samples a turn: sample faster, name the right column under recorded.columns.angle, or "
        "leave the angle out where there is a rate"
    )


def _jumps(time_s: Array, angle: Array) -> list[tuple[int, int]]:
    """The samples before and behind each jump of the angle to another level.

    A jump is looked for from one sample to the next, and where there is none, over one sample on the way.
    """
    if len(angle) < 50:
        return []
    y, step, spacing = angle, np.abs(np.diff(angle)), np.diff(time_s)
    hole = spacing > LOST_SPACING_RATIO * np.median(spacing)
    step[hole] = 0.0  # what the platform did there nobody knows
    blind = np.max([np.roll(hole, k) for k in range(-3, 4)], axis=0)
    # How far lines through two samples on either side miss each other half way between samples i and i + 1: through the
    # nearest two, and through those one and two farther out. A single wrong sample is in some of these lines only.
    near, middle, far = np.zeros((3, len(step)))
    near[3:-3] = _missed(y[2:-5], y[3:-4], y[4:-3], y[5:-2], 0.5)
    middle[3:-3] = _missed(y[1:-6], y[2:-5], y[5:-2], y[6:-1], 1.5)
    far[3:-3] = _missed(y[0:-7], y[1:-6], y[6:-1], y[7:], 2.5)
    noise = float(np.median(np.abs(np.diff(angle, 4)))) / (MEDIAN_SIGMAS * np.sqrt(70.0))
    resolution = float(np.min(step[step > 0.0], initial=np.inf))  # of an encoder that stands from time to time
    for beside, reach in ((near, 0), (middle, 1)):
        level = np.where(beside * far > 0.0, np.minimum(np.abs(beside), np.abs(far)), 0.0)
        level[blind | (level < JUMP_SIGMAS * noise)] = 0.0
        found = np.array(_standing_out(level, step, reach, resolution), dtype=int)
        if len(found):
            groups = np.split(found, 1 + np.flatnonzero(np.diff(found) > 2 * reach + 1))
            return [(int(g[0]) - reach, int(g[-1]) + 1 + reach) for g in groups]
    return []


def _standing_out(level: Array, step: Array, reach: int, resolution: float) -> list[int]:
    """Where the level rises by more than ``JUMP_RATIO`` times every step that is no such rise, in order of time.

    Parameters
    ----------
    level, step
        Shape (n,): by how much the level rises over each step, and the size of the step.
    reach
        Steps on either side that belong to a rise.
    """
    order = np.argsort(-level)
    order = order[: np.count_nonzero(level)]
    if not len(order):
        return []
    about = np.max([np.roll(step, k) for k in range(-reach, reach + 1)], axis=0)
    part = np.max([np.roll(level > 0.0, k) for k in range(-reach, reach + 1)], axis=0)
    elsewhere = max(float(np.max(step[~part], initial=0.0)), resolution)
    rest = np.append(np.maximum.accumulate(about[order][::-1])[::-1][1:], 0.0)
    sure = np.flatnonzero(level[order] > JUMP_RATIO * np.maximum(rest, elsewhere))
    return sorted(order[: sure[-1] + 1].tolist()) if len(sure) else []


def _missed(a: Array, b: Array, c: Array, d: Array, reach: float) -> Array:
    return (c - reach * (d - c)) - (b + reach * (b - a))


def _within_half_a_turn(step: Array) -> Array:
    return step - TURN * np.rint(step / TURN)


def _running_median(values: Array) -> Array:
    """Of ``NEIGHBOUR_STEPS`` values about each, the first and last repeated at the ends, shape (n,)."""
    half = NEIGHBOUR_STEPS // 2
    padded = np.pad(values, half, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOUR_STEPS), axis=1)
