"""What the sensors of a recording cannot show: it is not searched for, and set aside where it is declared."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from identify.model.parameters import Name
from identify.signals.trace import Trace, loads_differ
from rig import effects
from rig.arrays import Array
from rig.effects.base import Place

FAINT_LINE = 0.1  # of the amplitude in the loudest run: a run with less does not have what repeats in time
MAX_STRENGTH_SCATTER = 0.3  # of its mean amplitude, from run to run: more than any pump or fan changes by
MIN_RELAXED_SHARE = 0.1  # of the torque of an effect that relaxes, by which it does so in the longest run


def why_unseen(name: str, traces: Sequence[Trace]) -> str:
    """Why no run can show an effect; empty where one may."""
    if name == "rate_bias":
        return "a bias is always fitted to each run of a gyro, and an encoder has none"
    if name == "torque_offset" and all(t.biased for t in traces):
        return "with a gyro alone, a constant torque only shifts the angle of rest, which is not measured"
    if effects.get(name).place is Place.SENSOR and all(t.channel == "angle" and t.beside is None for t in traces):
        return "no gyro was recorded, and an encoder has no low-pass"
    if effects.get(name).place is Place.SENSOR and all(t.torque is None for t in traces):
        return "without torque, a late reading only shifts the motion in time"
    if effects.get(name).place is Place.DRIVE and all(t.torque is None for t in traces):
        return "no torque was applied, so effects of the drive do not show"
    return ""


def runs_last_for(name: str, values: Mapping[Name, float], traces: Sequence[Trace]) -> bool:
    """Whether a run is as long as a period of an effect that repeats, or shows an effect relax.

    What is slower is a drift as well as a period; and what does not relax is a spring from where the run began, which
    takes the place of a constant torque.
    """
    effect, longest_s = effects.get(name), max(len(t.measured) * t.step_s for t in traces)
    if effect.relaxes and values.get((name, effect.relaxes), 0.0) * MIN_RELAXED_SHARE > longest_s:
        return False
    return not effect.repeats or values.get((name, effect.repeats), 0.0) * longest_s >= 1.0


def is_as_strong_in_all(name: str, values: Mapping[Name, float], std_error: Callable[[Name], float]) -> bool:
    """Whether what repeats in time is as strong in every run that has it, but for its errors.

    A source in the surroundings does not know what is played. A drive that loses its gain while it warms up leaves a
    part of the excitation, in every run another one.
    """
    gains = {p.name for p in effects.get(name).parameters if p.linear and p.per_run}
    if not effects.get(name).repeats or not gains:
        return True
    of_run: dict[str, list[Name]] = {}
    for key in values:
        if key[0] == name and len(key) == 3 and key[1] in gains:
            of_run.setdefault(key[2], []).append(key)
    size = np.array([math.hypot(*(values[k] for k in keys)) for keys in of_run.values()])
    error = np.array([math.hypot(*(std_error(k) for k in keys)) for keys in of_run.values()])
    heard = are_heard(size)
    if np.count_nonzero(heard) < 2:
        return True
    excess = np.var(size[heard], ddof=1) - np.mean(error[heard] ** 2)
    return bool(excess <= (MAX_STRENGTH_SCATTER * np.mean(size[heard])) ** 2)


def are_heard(amplitudes: Array) -> NDArray[np.bool_]:
    """Which runs have what repeats in time, by its amplitude in each of them, (n,)."""
    return np.asarray(amplitudes > FAINT_LINE * np.max(amplitudes, initial=0.0))


def one_more(have: Sequence[str], values: Mapping[Name, float], traces: Sequence[Trace]) -> list[str]:
    """One more of an effect that is there; none of waves over the angle whose longest is not seen twice.

    A few orders of one that is no shorter than the travel are the Fourier series of any curve over the angle.
    """
    more = [m for n in have for m in effects.further(effects.first_of(n)) if m not in have]
    return [m for m in more if is_seen_to_repeat(effects.first_of(m), have, values, traces)][:1]


def is_seen_to_repeat(first: str, have: Sequence[str], values: Mapping[Name, float], traces: Sequence[Trace]) -> bool:
    """Whether the travel shows two periods of the longest wave of a kind; True where it is none over the angle."""
    order = effects.get(first).repeats_over_angle
    if not order:
        return True
    longest = min(values[n, order] for n in have if effects.first_of(n) == first)
    travel_rad = 2.0 * math.radians(max(t.travel_deg for t in traces))
    return longest * travel_rad >= 2.0 * math.tau


def can_show(name: str, traces: Sequence[Trace]) -> bool:
    """Whether an effect is worth a search: the sensors can show it, and there is what it needs."""
    return not why_unseen(name, traces) and (not effects.get(name).needs_added_inertia or loads_differ(traces))
