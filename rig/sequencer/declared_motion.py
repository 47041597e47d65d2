"""After a trip on travel or rate that was not predicted: late ticks, or the declared parameter that may be wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rig.errors import RigError, SafetyTrip
from rig.excitation import PlannedSet
from rig.guard import Trip
from rig.platform import Platform
from rig.preflight.simulated_sets import Peaks, SetForecast, SetSequence, has_no_restoring_spring
from rig.sequencer.held_torque import Pulse

CLEARLY = 0.8  # of the limit: a prediction above it is within what a declared model is good for
DECLARED_CHANGE_RATIO = 2.0  # by which each declared number is changed, to see which of them makes the motion larger
MIN_EXCESS_RATIO = 1.1  # times the predicted motion: less does not explain a trip
NAMED = 2  # suspects in a sentence


def explained(
    error: RigError,
    trip: Trip | None,
    pulses: Sequence[Pulse],
    declared: Platform | None,
    sets: Sequence[PlannedSet],
    rest_s: float,
) -> RigError:
    """The error of a trip with a sentence on what may have caused it; any other error as it is.

    Parameters
    ----------
    trip
        The broken limit behind the error, where there is one.
    pulses
        What late ticks did to the platform, seen from the trip.
    declared
        The platform that the pre-flight predicted with.
    sets
        Those played so far; the last is the one that tripped.
    rest_s
        Zero torque between sets, in seconds.
    """
    if not isinstance(error, SafetyTrip) or trip is None or declared is None or not sets:
        return error
    sentence = suspected_cause(trip, pulses, declared, sets, rest_s)
    return SafetyTrip(f"{error} {sentence}") if sentence else error


def suspected_cause(
    trip: Trip, pulses: Sequence[Pulse], declared: Platform, sets: Sequence[PlannedSet], rest_s: float
) -> str:
    """What may have caused it, in a sentence: late ticks where they suffice, else a declared number; empty where the
    prediction is near the limit, too."""
    quantity = next((n for n in ("travel_deg", "rate_deg_s") if f"limits.{n}" in trip.limit), None)
    if quantity is None:
        return ""
    predicted = float(getattr(_peaks(declared, sets, rest_s), quantity))
    if not predicted < CLEARLY * trip.allowed:
        return ""
    in_set = f"The declared model predicted at most {predicted:.3g} {trip.unit} in this set"
    added_of = Pulse.added_travel_rad if quantity == "travel_deg" else Pulse.added_rate_rad_s
    added_deg = [math.degrees(added_of(pulse, declared)) for pulse in pulses]
    if predicted + sum(added_deg) >= CLEARLY * trip.allowed:  # their phases taken for the worst
        worst = pulses[max(range(len(pulses)), key=added_deg.__getitem__)]
        return (
            f"{in_set}, but this computer was {worst.late_s * 1e3:.1f} ms late {worst.age_s:.2g} s before. The drive "
            f"held its torque meanwhile, which can add {sum(added_deg):.3g} {trip.unit}: stop other programs and "
            "repeat the campaign."
        )
    j, c, k = declared.inertia_kg_m2, declared.damping_nm_s_rad, declared.stiffness_nm_rad
    others = {
        "the declared inertia may be too large": replace(declared, inertia_kg_m2=j / DECLARED_CHANGE_RATIO),
        "the declared inertia may be too small": replace(declared, inertia_kg_m2=j * DECLARED_CHANGE_RATIO),
        "the declared stiffness may be too large": replace(declared, stiffness_nm_rad=k / DECLARED_CHANGE_RATIO),
        "the declared damping may be too large": replace(declared, damping_nm_s_rad=c / DECLARED_CHANGE_RATIO),
    }
    larger = {words: float(getattr(_peaks(p, sets, rest_s), quantity)) for words, p in others.items() if p != declared}
    suspects = [w for w in sorted(larger, key=lambda w: -larger[w]) if larger[w] > MIN_EXCESS_RATIO * predicted]
    what = " or ".join(suspects[:NAMED]) or "the declared model may lack an effect"
    return f"{in_set}: {what}."


def _peaks(platform: Platform, sets: Sequence[PlannedSet], rest_s: float) -> Peaks:
    """Of the last set; without a spring from where the sets before leave the platform."""
    if has_no_restoring_spring(platform, rest_s):
        peaks = SetSequence(platform, sets, rest_s).play([1.0] * len(sets))[-1].peaks
    else:
        peaks = SetForecast(platform, sets[-1]).play(1.0).peaks
    return peaks if all(math.isfinite(x) for x in peaks) else Peaks(math.inf, math.inf, math.inf)
