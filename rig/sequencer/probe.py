"""The probe: small pulses after arming, before any full torque, to check sign and scale of torque and rate.

Half a sine each, one way and the other, doubled until the platform answers clearly. From each answer follow all
inertias that fit nearly as well as the best (``rig.sequencer.pulse_inertia``). They have to lie within a factor of the
declared one and to be positive: torque and rate then have one sign and the right scale. Where some do and some do not,
a harder pulse the other way is asked; where even the largest moves nothing or leaves it open, that is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.config.bench import ProbeConfig
from rig.config.limits import LimitsConfig
from rig.errors import SafetyTrip
from rig.excitation import PlannedSet
from rig.guard.base import Rest, Tick
from rig.platform import Platform
from rig.sequencer.pulse_inertia import MIN_PULSE_SAMPLES, InertiaRange, estimate_inertia, initial_direction

MIN_PULSE_S, MAX_PULSE_S = 0.01, 0.1  # of a pulse: from ten samples at 1 kHz to what a campaign can wait for
PERIOD_SHARE = 0.5  # of the declared period of the ring: the length of a pulse
LISTEN_PERIODS = 0.6  # of the ring, after a pulse: beyond the first swing back
MAX_LATENESS_S = 0.05  # samples and torque may be so late
FIRST_RATE, MAX_RATE, MAX_TRAVEL = 0.05, 0.6, 0.3  # of the limits, by the declared model
# Ratio of torques: a further pulse has to be harder by this. It decides how closely the largest torque allowed is tried
# before a platform is called stuck: tests/rig/sequencer holds from 1.001 to 1.05.
MIN_STEP = 1.02
# Ratio to the first pulse: three doublings. By the declared model this is 8 FIRST_RATE = 0.4 of the rate limit.
GENTLE_STEPS = 8.0
MAX_PROBE_TORQUE_SHARE = 0.3  # of the campaign's
# A response counts if its peak exceeds both: so many standard deviations of the noise (the peak is then known to 1 in
# 40), and this rate. More of either takes harder pulses, less trusts a smaller motion. Calibration:
# tests/rig/sequencer holds from 5 to 160 sigma and from 0.5 to 12 deg/s; above, a scale wrong by three is no longer
# recognised under 15 N m of friction.
CLEAR_SIGMAS, CLEAR_MIN_RAD_S = 40.0, math.radians(5.0)
MAX_LEVELS = 16  # pulses: doublings from the first torque to any limit
RANGE_TOLERANCE = 0.9  # a range may stick out of the allowed one by a tenth
# Of the peak rate of a pulse: slower at its beginning, the platform started from rest, and its first motion gives the
# sign; else the sign of the pulse before is kept. Not critical: tests/rig/sequencer holds from 0.005 to 0.4.
STILL_SHARE = 0.05
STIFFNESS_FACTOR = 3.0  # the declared one may be wrong by so much
STEPS = 400  # integration steps a pulse


@dataclass(frozen=True)
class PulseResponse:
    """What one pulse told. ``inertia`` is None where it moved too little, or followed no law like that above."""

    torque_nm: float
    peak_rad_s: float
    inertia: InertiaRange | None


class Probe:
    """Pulses to play and the verdict on them. No clock, no device: it is asked for torque and given the ticks.

    Parameters
    ----------
    config, limits
        What the file allows.
    platform
        The declared one.
    sets
        The campaign that the probe precedes.
    """

    def __init__(
        self, config: ProbeConfig, limits: LimitsConfig, platform: Platform, sets: Sequence[PlannedSet]
    ) -> None:
        self._config, self._platform = config, platform
        j, k = platform.inertia_kg_m2, platform.stiffness_nm_rad
        period_s = 2.0 * math.pi * math.sqrt(j / k) if k > 0.0 else math.inf
        self.pulse_s = min(max(PERIOD_SHARE * period_s, MIN_PULSE_S), MAX_PULSE_S)
        self._listen_s = min(LISTEN_PERIODS * period_s, MAX_PULSE_S)
        peak_rate, peak_angle = _predicted_response(platform, self.pulse_s)
        rate = math.radians(limits.rate_deg_s)
        # What a harder pulse adds, were the inertia half of what is declared, has to stay below these.
        self._rate_per_nm, self._most_rad_s = 2.0 * peak_rate, MAX_RATE * rate
        self._step_nm = MAX_TRAVEL * math.radians(limits.travel_deg) / (2.0 * peak_angle)
        campaign_nm = max(_peak_torque_nm(s) for s in sets) if sets else limits.torque_nm
        given = config.torque_nm
        first_nm = FIRST_RATE * rate / peak_rate
        # A campaign of little torque is probed with more of it, as far as that is little for the platform.
        own_nm = max(MAX_PROBE_TORQUE_SHARE * campaign_nm, min(campaign_nm, GENTLE_STEPS * first_nm))
        self.largest_nm = min(own_nm if given is None else given, limits.torque_nm)
        self._torque_nm = min(first_nm, self.largest_nm)
        self._direction, self._sign = 1.0, 0.0
        self._clear_rate_per_nm = 0.25 * peak_rate
        self._responses: list[PulseResponse] = []
        self._pulse_at_s = 0.0
        self._samples: list[tuple[float, float]] = []
        self._rest = Rest()
        self._stiffest_nm_rad = STIFFNESS_FACTOR * k if k > 0.0 else math.inf
        self.over = False

    def begin(self, rest: Rest) -> None:
        """Nothing was played yet; what the gyro reads at rest."""
        self._rest = rest

    def torque(self, at_s: float) -> float:
        """Torque in N m at seconds since the probe began."""
        x = (at_s - self._pulse_at_s) / self.pulse_s
        return self._direction * self._torque_nm * math.sin(math.pi * x) if 0.0 <= x <= 1.0 and not self.over else 0.0

    def take(self, at_s: float, start_s: float, tick: Tick) -> None:
        """What a tick brought; ``start_s`` is when the probe began on the clock of the ticks."""
        self._samples += [(t - start_s, w - self._rest.bias_rad_s) for t, w, valid in tick.gyro if valid]
        if at_s - self._pulse_at_s >= self.pulse_s + self._listen_s + MAX_LATENESS_S:
            self._end_pulse(at_s)

    def _end_pulse(self, at_s: float) -> None:
        answer = self._evaluate_pulse(self._clear_rate_per_nm)
        room_nm = min((self._most_rad_s - answer.peak_rad_s) / self._rate_per_nm, self._step_nm, self._torque_nm)
        next_nm = min(self._torque_nm + room_nm, self.largest_nm)
        is_last = next_nm < MIN_STEP * self._torque_nm or len(self._responses) >= MAX_LEVELS
        if is_last and answer.inertia is None:
            answer = self._evaluate_pulse(0.0)  # what little there is has to do, friction being fitted too
        self._responses.append(answer)
        if is_last or (answer.inertia is not None and self._is_clear(answer.inertia)):
            self.over = True
            return
        self._torque_nm = next_nm
        self._direction = -self._direction  # back again: friction may have left it beside its spring
        self._pulse_at_s = at_s
        self._samples.clear()

    def _is_clear(self, found: InertiaRange) -> bool:
        """Whether all that fits is allowed, give or take a tenth, or nothing of it."""
        factor = self._config.inertia_factor
        least, most = self._platform.inertia_kg_m2 / factor, self._platform.inertia_kg_m2 * factor
        if least <= found.best <= most:
            return RANGE_TOLERANCE * least <= found.low and RANGE_TOLERANCE * found.high <= most
        return found.high < least or found.low > most

    def _evaluate_pulse(self, clear_share: float) -> PulseResponse:
        data = np.array(self._samples, dtype=float).reshape(-1, 2)
        data = data[(data[:, 0] >= self._pulse_at_s) & (data[:, 0] <= self._pulse_at_s + self.pulse_s + self._listen_s)]
        peak = float(np.max(np.abs(data[:, 1]))) if len(data) else 0.0
        clear = max(CLEAR_SIGMAS * self._rest.noise_rad_s, CLEAR_MIN_RAD_S, clear_share * self._torque_nm)
        # An answer that is larger than foreseen is clear too: the inertia may be the one that is wrong.
        if peak < clear or len(data) < MIN_PULSE_SAMPLES:
            return PulseResponse(self._torque_nm, peak, None)
        if self._sign == 0.0 or abs(data[0, 1]) < STILL_SHARE * peak:  # else it still rings from the pulse before
            self._sign = self._direction * initial_direction(data[:, 1])
        span = estimate_inertia(
            data[:, 0] - self._pulse_at_s, self._sign * data[:, 1], self._direction * self._torque_nm, self.pulse_s,
            self._stiffest_nm_rad,
        )  # fmt: skip
        if span is not None and self._sign < 0.0:
            span = InertiaRange(-span.best, -span.high, -span.low)
        return PulseResponse(self._torque_nm, peak, span)

    def finding(self) -> str:
        """What came of it, in a sentence. Raises SafetyTrip where the campaign must not go on."""
        last = self._responses[-1]
        declared, factor = self._platform.inertia_kg_m2, self._config.inertia_factor
        asked = f"{last.torque_nm:.3g} N m for {self.pulse_s * 1e3:.0f} ms"
        peak_deg_s = math.degrees(last.peak_rad_s)
        if last.inertia is None:
            raise SafetyTrip(
                f"Torque is off. The probe found no clear answer: {asked} gave {peak_deg_s:.2g} deg/s at most. Check "
                "for an applied brake, a stuck platform, a disconnected motor, or a gyro that is loose on its shaft. "
                "If friction holds the platform, raise bench.probe.torque_nm. Nothing was played."
            )
        found, low, high = last.inertia
        if high < 0.0:
            raise SafetyTrip(
                f"Torque is off. The probe found torque and rate with opposite signs: {asked} gave the response of an "
                f"inertia of {found:.3g} kg m2. Change one of bench.amplifier.invert and bench.gyroscope.invert. "
                "Nothing was played."
            )
        if not self._is_clear(last.inertia):
            raise SafetyTrip(
                f"Torque is off. The probe found no clear answer: {asked} gave {peak_deg_s:.3g} deg/s, which "
                f"fits any inertia from {low:.3g} to {high:.3g} kg m2; declared {declared:.3g}, allowed "
                f"{declared / factor:.3g} to {declared * factor:.3g}. High friction hides the scale: raise "
                "bench.probe.torque_nm, correct model.inertia_kg_m2, or widen bench.probe.inertia_factor. Nothing was "
                "played."
            )
        if not 1.0 / factor <= found / declared <= factor:
            raise SafetyTrip(
                f"Torque is off. The probe found an inertia of {found:.3g} kg m2 ({asked}, {peak_deg_s:.3g} deg/s); "
                f"declared {declared:.3g}, allowed {declared / factor:.3g} to {declared * factor:.3g}. Check "
                "the drive's torque scale and gear ratio, the gyro's axis, and model.inertia_kg_m2 (or "
                "bench.probe.inertia_factor). Nothing was played."
            )
        return (
            f"probe: {asked} gave {peak_deg_s:.3g} deg/s, which fits an inertia of {found:.3g} kg m2 "
            f"(declared {declared:.3g}): sign and scale are correct"
        )


def _predicted_response(platform: Platform, pulse_s: float) -> tuple[float, float]:
    """Largest rate and angle per N m of a pulse on the declared linear platform."""
    j, c, k = platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad
    step_s = pulse_s / STEPS
    angle = rate = peak_rate = peak_angle = 0.0
    for i in range(2 * STEPS):
        torque = math.sin(math.pi * i / STEPS) if i < STEPS else 0.0
        rate += (torque - c * rate - k * angle) / j * step_s
        angle += rate * step_s
        peak_rate, peak_angle = max(peak_rate, abs(rate)), max(peak_angle, abs(angle))
    return peak_rate, peak_angle


def _peak_torque_nm(planned: PlannedSet) -> float:
    times = np.linspace(0.0, planned.duration_s, 2001)
    return float(np.max(np.abs(planned.torque(times))))
