"""A steady line in the gyro, or a torque that shakes the platform: what the beginning of a run and a known mass tell.

A torque tone moves a linear platform as a line of the sensor's own (a vibration aliased into the band, pickup) moves
its reading, once the platform stands in its steady motion. Apart they are where the platform gets there only during
the run, as one does that was at rest, and where a known mass changes how far the same torque moves it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from identify.estimate.evaluation import settled
from identify.estimate.final_fit import FinalFit
from identify.model.parameters import equations_of
from identify.runs.observability import are_heard
from identify.signals.trace import UPSAMPLING, Trace, loads_differ
from identify.simulate.all_runs import shots_for
from identify.simulate.shots import RUNAWAY, Shots, losses_of, predict
from identify.wording import joined, number
from rig.dynamics import Equations
from rig.recording.run import Array

TONE = "periodic_disturbance"
DECISIVE = 25.0  # times the noise's variance by which one beginning has to fit better than the other
AS_GOOD = 0.25  # of what the other beginning loses: losses that the platform's other effects may cost a steady one
MIN_EXCITED_AMPLITUDE = 0.1  # of a run's torque: from there it excites the platform at the line's frequency itself
MOVED = 0.05  # relative: by which the mass has to change how far the line's torque moves the platform
MAX_AMPLITUDE_SCATTER = 0.3  # of the scatter of the other: amplitudes that are the same in every run
SOON_S = 0.1  # a run whose first sample that counts comes later does not show how it began


FOLDS_BACK = (
    "Look for a vibration above half of the sample rate that folds back (record once at another rate: it moves), or "
    "for pickup on the cable."
)
MOUNT = "Repeat a set with a known mass on the platform (added_inertia_kg_m2)"
HEAVIER = "The known mass did not decide it: use a heavier one, and keep the line's source equally strong in all runs"
DIFFERS = (
    "Compare {runs} with the others: the amplifier's gain and limits, and the time stamps of torque and rate. "
    "Play that set again, with one of the others at its frequency; leave the run out if it does not repeat."
)
TELLS = (
    ": that changes how far a {kind} moves the platform, but not a line of the sensor. Or switch the source on with "
    "the run, at rest. Or record at another sample rate: an aliased vibration then changes its frequency. If you know "
    "that it is a {kind} (a pump, a fan), declare it: model.effects.periodic_disturbance: {{sine_nm: {torque:.3g}, "
    "cosine_nm: 0, frequency_hz: {hertz:.6g}}}."
)


@dataclass(frozen=True)
class SpectralLine:
    """A line whose origin a recording does not tell.

    Attributes
    ----------
    torque_nm, rate_rad_s
        Amplitude, if it is a torque on the platform, and if it is the sensor's own.
    only
        The runs in which it is heard, where not in all.
    loaded
        Runs with and without a known mass are there.
    in_sensor
        The known mass leaves the line as it is, which it does to no torque.
    stood
        The runs show that it was there before them; else they do not show how they began.
    of_torque
        It is heard in the runs whose own torque has that frequency, and in no other.
    """

    frequency_hz: float
    torque_nm: float
    rate_rad_s: float
    only: tuple[str, ...] = ()
    loaded: bool = False
    in_sensor: bool = False
    stood: bool = False
    of_torque: bool = False


def standing_line(fitted: FinalFit, traces: Sequence[Trace]) -> SpectralLine | None:
    """The tone of a fit where it may as well be a line of the sensor; None where it is a torque, or none was fitted.

    A torque shows in how the runs begin, or in what a known mass makes of it; where neither tells, it is left open.
    """
    if TONE not in fitted.structure.effects or all(t.torque is None for t in traces):
        return None
    fitted_in = [t for t in traces if (TONE, "sine", str(t.number)) in fitted.values]
    sizes = np.abs(np.array([_amplitudes(fitted, t) for t in fitted_in]).reshape(-1, 2))  # torque, rate
    heard = are_heard(sizes[:, 1])
    if not np.any(heard):
        return None
    torque_nm, rate_rad_s = (float(np.median(s)) for s in sizes[heard].T)
    some = [t.run.name for t, yes in zip(fitted_in, heard, strict=True) if yes]
    only = () if np.all(heard) else tuple(some)
    line = SpectralLine(fitted.values[TONE, "frequency"], torque_nm, rate_rad_s, only, loads_differ(traces))
    if only and all(_is_excited_at(t, line.frequency_hz) == yes for t, yes in zip(fitted_in, heard, strict=True)):
        return replace(line, of_torque=True)
    mobility = sizes[:, 1] / np.maximum(sizes[:, 0], 1e-300)
    if line.loaded and np.ptp(mobility) > MOVED * np.mean(mobility):
        torque, rate = np.std(sizes, axis=0) / np.mean(sizes, axis=0)
        if torque < MAX_AMPLITUDE_SCATTER * rate:
            return None
        if rate < MAX_AMPLITUDE_SCATTER * torque:
            return replace(line, in_sensor=True)
    begun = _beginning(fitted, traces)
    return None if begun == "at rest" else replace(line, stood=begun == "steady")


def _amplitudes(fitted: FinalFit, trace: Trace) -> tuple[complex, complex]:
    """Torque and the rate of its steady motion in one run, complex: the real part of it times exp(i w t)."""
    v, run = fitted.values, str(trace.number)
    torque = -(v[TONE, "cosine", run] - 1j * v[TONE, "sine", run])
    s = 2j * np.pi * v[TONE, "frequency"]
    j, c, k = (v.get((n,), 0.0) for n in ("inertia", "damping", "stiffness"))
    return torque, torque * s / ((j + trace.run.added_inertia_kg_m2) * s * s + c * s + k)


def _is_excited_at(trace: Trace, hertz: float) -> bool:
    """Whether a run's own torque has a line there."""
    if trace.torque is None:
        return False
    torque = trace.fine[3][::UPSAMPLING]
    window = np.hanning(len(torque)) / np.sum(np.hanning(len(torque)))  # keeps a short run's neighbours out
    there = 2.0 * abs(np.sum(window * torque * np.exp(-2j * np.pi * hertz * trace.step_s * np.arange(len(torque)))))
    return bool(there > MIN_EXCITED_AMPLITUDE * np.sqrt(2.0) * np.std(torque))


def describe(line: SpectralLine, axis: str, channel: str = "rate") -> tuple[str, str]:
    """The line in words, of the channel that was measured, and what would tell where it comes from."""
    linear = axis == "linear"
    torque = f"{number(line.torque_nm, 3)} {'N' if linear else 'N m'}"
    size = line.rate_rad_s if channel == "rate" else line.rate_rad_s / (2.0 * math.pi * line.frequency_hz)
    units = ("m" if linear else "deg") + ("/s" if channel == "rate" else "")
    rate = f"{number(size if linear else math.degrees(size), 3)} {units}"
    name = f"A steady line at {line.frequency_hz:.5g} Hz" + (f" (only in {joined(line.only)})" if line.only else "")
    if line.in_sensor:
        return (
            f"{name}, {rate}, comes from the sensor and is no {'force' if linear else 'torque'}: in runs with a "
            "known added mass it is as large as in the others."
        ), FOLDS_BACK
    if line.of_torque:
        one, what = len(line.only) == 1, "force" if linear else "torque"
        return (
            f"{name} is no disturbance: {'that run has' if one else 'those runs have'} a {what} of that frequency, and "
            f"the others are silent there. There the applied {what} differed from the recorded one by {torque}, or "
            "was shifted in time."
        ), DIFFERS.format(runs=joined(line.only))
    why = (
        "The platform already moved steadily with it when the runs began, so the two look the same."
        if line.stood
        else "The runs do not begin at rest, so the two look the same."
    )
    kind = "force" if linear else "torque"
    return (
        f"{name} is left open: a {kind} of {torque} on the platform, or {rate} from the sensor (a vibration above "
        f"half of the sample rate that folds back, pickup). {why}"
    ), (HEAVIER if line.loaded else MOUNT) + TELLS.format(kind=kind, torque=line.torque_nm, hertz=line.frequency_hz)


@RUNAWAY
def _beginning(fitted: FinalFit, traces: Sequence[Trace]) -> Literal["at rest", "steady", "unknown"]:
    """Whether the platform was at rest when the runs began, or in the tone's steady motion.

    Without a spring it may have stood anywhere.
    """
    names, x = tuple(fitted.values), np.array(list(fitted.values.values()))
    turn = 2.0 * np.pi * fitted.values[TONE, "frequency"]
    sounds = np.array([len(n) == 3 and n[0] == TONE for n in names])
    losses = np.zeros(3)  # at rest, in steady motion, from anywhere
    for shots in shots_for(traces, fitted.structure, names, x, None, None, None, coarse=False):
        trace = shots.trace
        if trace.stretches[0][0] * trace.step_s > SOON_S or (TONE, "sine", str(trace.number)) not in fitted.values:
            continue
        equations = equations_of(fitted.structure, names, x, shots.number, shots.added)
        begun = _from_first_sample(shots)
        _, rate = _amplitudes(fitted, trace)
        now = rate * np.exp(1j * turn * trace.start_s)
        moving = np.array([(now / (1j * turn)).real, now.real])
        if trace.channel == "angle" and "stiffness" not in fitted.structure.terms:
            rest = np.array([shots.starts[0, 0], 0.0])
            moving[0] = 0.0
        else:
            still = equations_of(fitted.structure, names, np.where(sounds, 0.0, x), shots.number, shots.added)
            rest = np.array([still.rest_angle_rad(), 0.0])
        tried = [_loss(begun, equations, start) for start in (rest, rest + moving)]
        begun.starts[:] = rest if tried[0] < tried[1] else rest + moving
        _, free = settled(begun, fitted.structure, names, x)
        losses += np.array([*tried, float(np.sum(free))])
    rest_, steady, free_ = losses / fitted.fit.variance
    if steady - rest_ > DECISIVE and rest_ - free_ < AS_GOOD * (steady - free_):
        return "at rest"
    return "steady" if rest_ - steady > DECISIVE and steady - free_ < AS_GOOD * (rest_ - free_) else "unknown"


def _from_first_sample(shots: Shots) -> Shots:
    """The first usable stretch of a run, simulated from the run's first sample on."""
    weight = shots.weight.copy()
    weight[shots.trace.stretches[0][1] + 1 :] = False
    return Shots(shots.trace, shots.grid, np.array([0]), np.zeros((1, 2)), shots.bias, weight)


def _loss(shots: Shots, equations: Equations, start: Array) -> float:
    """Sum of squares from a start state, the gyro's bias as it comes out best there."""
    residual = shots.trace.measured - predict(shots, equations, start[None, :], 0.0)
    bias = float(np.mean(residual[shots.weight])) if shots.trace.biased else 0.0
    return float(np.sum(losses_of(shots, residual - bias)))
