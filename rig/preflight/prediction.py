"""Pre-flight: what every set would do to the declared platform, start transient included, before it moves.

A set from rest rings: the published 300 N m at 0.5 Hz travel 25 degrees where 10 are allowed, and the ring
adds up to 3 degrees to a set that would fit in steady state. So each set is simulated whole, and one that
would break a limit is refused with the torque that would pass, or scaled where the configuration says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rig.config.excitation import ExcitationConfig
from rig.config.limits import LimitsConfig
from rig.errors import PreflightRefusal
from rig.excitation import PlannedSet, planned
from rig.platform import Platform
from rig.preflight.declared_model import model_hint, unstable_keys
from rig.preflight.simulated_sets import (
    Peaks,
    SetForecast,
    SetSequence,
    has_no_restoring_spring,
    largest_factor,
)
from rig.rounding import rounded_down

MIN_REPORTED_DEG = 0.005  # half of the last digit shown
LIMIT_KEYS = ("limits.travel_deg", "limits.rate_deg_s", "limits.torque_nm")
__all__ = ["Peaks", "Prediction", "peaks", "plan", "predict", "predict_all"]


@dataclass(frozen=True)
class Prediction:
    """What one set would do.

    Parameters
    ----------
    planned
        The set as asked for.
    peaks
        Predicted with the torque as asked for.
    allowed
        The limits it was held against, margin included where the set is scaled.
    scale
        The largest factor (at most 1) on the torque with which all limits hold; 0 where none does.
    keys
        Of the configuration: what decides the allowed travel, rate and torque.
    margin
        Share of the limits that is allowed (`excitation.margin`), 1 where the set is not scaled.
    starts_deg
        How far from where the campaign began the sets before leave the platform, where no spring pulls it back.
    """

    planned: PlannedSet
    peaks: Peaks
    allowed: Peaks
    scale: float
    keys: tuple[str, str, str] = LIMIT_KEYS
    starts_deg: float = 0.0
    margin: float = 1.0

    @property
    def passes(self) -> bool:
        """Whether the set may be played as asked for."""
        return self.scale >= 1.0

    @property
    def largest_torque_nm(self) -> float:
        """The peak torque of the set that would pass."""
        return self.peaks.torque_nm * self.scale

    @property
    def broken(self) -> tuple[str, ...]:
        """The keys whose limits the set as asked for would break."""
        found = zip(self.keys, self.peaks, self.allowed, strict=True)
        return tuple(key for key, value, limit in found if not value <= limit)

    def describe(self) -> str:
        """One line for the operator."""
        motion = self._describe_motion()
        if self.passes:
            return f"{motion}, within the limits"
        most = f"At most {self._allowed_torque} is allowed" if self.scale > 0 else "No torque is small enough"
        if not self.broken:
            return f"{motion}, within the limits for the set alone but not after the sets before it. {most}"
        return f"{motion}. This exceeds {self._describe_broken()}. {most}"

    def describe_as_played(self) -> str:
        """The same line of a set that is played with the torque that is allowed."""
        if self.passes or self.scale <= 0:
            return self.describe()
        broken = [name for (name, _), key in zip(_UNITS, self.keys, strict=True) if key in self.broken]
        limits = f"the {_joined(broken)} limit{'s' if len(broken) > 1 else ''}" if broken else "the limits"
        reason = f"This exceeds {self._describe_broken()}" if broken else "This is too much after the sets before it"
        return (
            f"{self._describe_motion()}. {reason}. Reduced to {self._allowed_torque} ({100 * self.scale:.1f} %) "
            f"to stay within {limits}."
        )

    @property
    def _allowed_torque(self) -> str:
        return f"{rounded_down(self.largest_torque_nm)} N m"

    def _describe_motion(self) -> str:
        text = (
            f"{self.planned.name}: {self.peaks.torque_nm:.1f} N m would move the platform by "
            f"{self.peaks.travel_deg:.2f} deg at up to {self.peaks.rate_deg_s:.0f} deg/s"
        )
        if abs(self.starts_deg) >= MIN_REPORTED_DEG:
            text += f", starting {self.starts_deg:.2f} deg from the start of the campaign"
        return text

    def _describe_broken(self) -> str:
        units = zip(_UNITS, self.allowed, self.keys, strict=True)
        broken = [
            f"the {name} limit of {limit:g} {unit}{' (travel_cap_deg of the set)' if self._is_own(name, limit) else ''}"
            for (name, unit), limit, key in units
            if key in self.broken
        ]
        return _joined(broken)

    def _is_own(self, name: str, limit: float) -> bool:
        """Whether a limit is the set's own."""
        return name == "travel" and limit == self.planned.excitation.travel_cap_deg

    def origins(self) -> dict[str, str]:
        """The limits of the campaign that the set would break, with where they come from, by name."""
        units = zip(_UNITS, self.allowed, self.keys, strict=True)
        return {
            name: f"{name} {limit:g} {unit} ({self._describe_origin(limit, key)})"
            for (name, unit), limit, key in units
            if key in self.broken and not self._is_own(name, limit)
        }

    def _describe_origin(self, limit: float, key: str) -> str:
        """Where a limit comes from, with the numbers that the file has: "10 by limits.travel_deg, times ..."."""
        of_gyro = "" if key in LIMIT_KEYS else ", full scale of the gyro"
        if self.margin == 1.0:
            return f"{key}{of_gyro}"
        return f"{limit / self.margin:g} by {key}{of_gyro}, times excitation.margin {self.margin:g}"


_UNITS = (("travel", "deg"), ("rate", "deg/s"), ("torque", "N m"))


def _joined(words: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)


def limits_broken(predictions: Sequence[Prediction]) -> str:
    """The limits that some set would break, each once, and where they come from; empty where there are none."""
    origins = {name: said for p in predictions for name, said in p.origins().items()}
    return ", ".join(origins.values())


def peaks(platform: Platform, planned_set: PlannedSet, scale: float = 1.0) -> Peaks:
    """Largest travel, rate and torque of a set played from rest on the declared platform."""
    return SetForecast(platform, planned_set).play(scale).peaks


def predict(
    platform: Platform, planned_set: PlannedSet, allowed: Peaks, keys: tuple[str, str, str] = LIMIT_KEYS
) -> Prediction:
    """Predict one set and the largest factor on its torque with which every limit holds.

    A linear platform answers in proportion; with effects the factor is found by bisection.
    """
    cap = planned_set.excitation.travel_cap_deg
    if cap is not None:
        allowed = allowed._replace(travel_deg=min(allowed.travel_deg, cap))
    forecast = SetForecast(platform, planned_set)
    found = forecast.play(1.0).peaks
    if found.within(allowed):
        return Prediction(planned_set, found, allowed, 1.0, keys)
    if not platform.effects:
        ratios = [limit / value for value, limit in zip(found, allowed, strict=True) if value > 0.0]
        return Prediction(planned_set, found, allowed, min(1.0, *ratios), keys)
    scale = largest_factor(lambda factor: forecast.play(factor).peaks.within(allowed))
    return Prediction(planned_set, found, allowed, scale, keys)


def _predict_together(
    platform: Platform, alone: Sequence[Prediction], allowed: Peaks, rest_s: float
) -> tuple[Prediction, ...]:
    """Sets that pass one by one, from where the ones before leave the platform: all lowered alike until they fit."""
    chain = SetSequence(platform, [p.planned for p in alone], rest_s)
    asked = chain.play([1.0] * len(alone))
    factor = chain.common_factor([p.scale for p in alone], allowed)
    return tuple(
        replace(p, peaks=stretch.peaks, scale=factor * p.scale, starts_deg=stretch.starts_deg)
        for p, stretch in zip(alone, asked, strict=True)
    )


def allowed_peaks(limits: LimitsConfig, margin: float = 1.0, rate_full_scale_rad_s: float | None = None) -> Peaks:
    """The limits times a margin; the gyro's full scale is a limit too, for beyond it there is no data."""
    rate = limits.rate_deg_s
    if rate_full_scale_rad_s is not None:
        rate = min(rate, math.degrees(rate_full_scale_rad_s))
    return Peaks(limits.travel_deg * margin, rate * margin, limits.torque_nm * margin)


def predict_all(
    platform: Platform,
    excitation: ExcitationConfig,
    limits: LimitsConfig,
    rate_full_scale_rad_s: float | None = None,
    full_scale_key: str = LIMIT_KEYS[1],
) -> tuple[Prediction, ...]:
    """Predict every set of a campaign, repeats included, against the limits (times the margin if scaled)."""
    margin = excitation.margin if excitation.scale_to_limits else 1.0
    allowed = allowed_peaks(limits, margin, rate_full_scale_rad_s)
    clips = rate_full_scale_rad_s is not None and math.degrees(rate_full_scale_rad_s) < limits.rate_deg_s
    keys = (LIMIT_KEYS[0], full_scale_key if clips else LIMIT_KEYS[1], LIMIT_KEYS[2])
    found = (predict(platform, s, allowed, keys) for s in planned(excitation.sets))
    alone = tuple(replace(p, margin=margin) for p in found)
    if len(alone) < 2 or not has_no_restoring_spring(platform, excitation.rest_s):
        return alone
    return _predict_together(platform, alone, allowed, excitation.rest_s)


def plan(
    platform: Platform,
    excitation: ExcitationConfig,
    limits: LimitsConfig,
    rate_full_scale_rad_s: float | None = None,
    full_scale_key: str = LIMIT_KEYS[1],
) -> tuple[PlannedSet, ...]:
    """The sets to play, scaled where the configuration allows it.

    Raises
    ------
    PreflightRefusal
        Listing every set with its predicted travel and the torque that would pass.
    """
    predictions = predict_all(platform, excitation, limits, rate_full_scale_rad_s, full_scale_key)
    return playable_sets(predictions, platform, excitation)


def playable_sets(
    predictions: Sequence[Prediction], platform: Platform, excitation: ExcitationConfig
) -> tuple[PlannedSet, ...]:
    """As ``plan``, from predictions that were made before; raises PreflightRefusal alike."""
    playable = [_playable(p, excitation.scale_to_limits) for p in predictions]
    sets = tuple(s for s in playable if s is not None)
    if len(sets) < len(predictions):
        error = PreflightRefusal(refusal(predictions, platform, excitation.scale_to_limits))
        error.keys = unstable_keys(platform) or tuple(dict.fromkeys(key for p in predictions for key in p.broken))
        raise error
    return sets


def _playable(p: Prediction, scale_to_limits: bool) -> PlannedSet | None:
    if p.passes:
        return p.planned
    # A set with a travel cap of its own asks to be scaled.
    may_scale = scale_to_limits or p.planned.excitation.travel_cap_deg is not None
    if may_scale and p.scale > 0.0:
        return p.planned.scaled(p.scale)
    return None


def refusal(predictions: Sequence[Prediction], platform: Platform, scaling: bool = False) -> str:
    """The message that refuses a campaign: every set, what it would do, and how to mend it."""
    failing = [p for p in predictions if not p.passes]
    lines = [f"{len(failing)} of {len(predictions)} sets would break a limit; nothing was moved."]
    if not unstable_keys(platform):  # which runs away at any torque: figures of each set would say nothing
        origins = limits_broken(predictions)
        lines += [f"  limits: {origins}"] if origins else []
        lines += [f"  {p.describe()}" for p in predictions]
    hint = model_hint(platform)
    if hint:
        lines.append(hint)
    elif not scaling:
        lines.append(
            "Lower torque_nm of these sets, or set excitation.scale_to_limits: true, or raise the limit in the "
            "section `limits` if the machine allows it."
        )
    return "\n".join(lines)
