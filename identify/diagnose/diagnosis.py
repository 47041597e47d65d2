"""What a residual consists of: harmonics of the excitation, free lines, direction of motion, memory, moments.

Every figure is a power of the residual. The same is asked of draws of the sensor's noise, sent through the same
differentiator, low-pass and drift removal: what these show is what chance shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from identify.diagnose.free_lines import free_lines, without_lines
from identify.diagnose.harmonics import Repeated, harmonics
from identify.diagnose.memory import RunResiduals, direction_power, memory_power
from identify.diagnose.moments import moments
from identify.results import UNITS, Harmonics, Identification, ResidualDiagnosis, RunTraces, Share
from identify.signals.low_pass import low_pass, settled
from identify.signals.period import torque_period_s
from rig.platform import Platform
from rig.recording.run import Array

DRAWS = 8  # of white noise, for what the sensor alone would leave
CHANCE_SIGMAS = 8.0  # standard deviations above what the draws show on average
MIN_DIAGNOSED_SAMPLES = 500  # samples of all runs: of fewer nothing is told
OVERSAMPLED = 8.0  # samples in a period of the low-pass's cut-off: more tell nothing more
MIN_HARMONIC_SHARE = 0.01  # of the residual's power: a single multiple with less is not told
ASTRAY = 0.5  # of the motion


@dataclass(frozen=True)
class Sensor:
    """What the noise of the residual is made of."""

    noise: float  # one standard deviation of the measured channel
    platform: Platform | None  # that takes it to a torque
    lowpass_hz: float | None


def diagnose(
    traces: Sequence[RunTraces], sensor: Sensor, floors: tuple[float | None, ...], units: tuple[str, str]
) -> tuple[ResidualDiagnosis, ...]:
    """Diagnosis of the declared and of the final model, in that order; nothing where there is too little to tell.

    Parameters
    ----------
    floors
        Residual over the noise floor of each model.
    units
        Of the torque and of the measured channel.
    """
    torque = all(t.torque_residual_before is not None and t.torque_residual_after is not None for t in traces)
    if not traces or (torque and sensor.platform is None):
        return ()
    runs = [_run(t, sensor, torque, i) for i, t in enumerate(traces)]
    count = sum(int(np.sum(r.use)) for r in runs)
    if count < MIN_DIAGNOSED_SAMPLES or not all(np.all(np.isfinite(r.left)) for r in runs):
        return ()
    total = np.mean(np.concatenate([r.left[r.use] for r in runs]) ** 2, axis=0)
    if not np.all(total[:2] > 0.0):
        return ()
    known = torque and all(t.torque_nm is not None for t in traces)
    periods = [torque_period_s(t) for t in traces]
    lines = free_lines(runs, periods, _natural_hz(sensor), sensor.lowpass_hz)
    rest = [without_lines(run, lines) for run in runs]
    repeated = harmonics(rest, periods) if known else None
    direction = _shares(direction_power(rest), total) if known else None
    memory = _shares(memory_power(rest), total) if known else None
    quantity: Literal["torque", "rate", "angle"] = "torque" if torque else traces[0].channel
    brief = moments(runs, [float(t.time_s[0]) for t in traces], [t.name for t in traces])
    return tuple(
        ResidualDiagnosis(
            quantity, units[0] if torque else units[1], floors[i], _harmonics(repeated, i) if repeated else None,
            lines[i], direction[i] if direction else None, memory[i] if memory else None, brief[i],
        )
        for i in (0, 1)
    )  # fmt: skip


def with_diagnosis(found: Identification) -> Identification:
    """The same with what the residuals of the declared and of the final model hold."""
    error, floor, units = found.final.error, found.noise_floor, UNITS[found.axis]
    models = (found.before.error, error)
    if any(e.residual_rms_torque is None for e in models) or not floor.residual_rms_torque:
        floors = tuple(_over(e.holdout_rate_rms, floor.holdout_rate_rms) for e in models)
    else:
        floors = tuple(_over(e.residual_rms_torque, floor.residual_rms_torque) for e in models)
    sensor = Sensor(floor.holdout_rate_rms, found.final.platform, error.lowpass_hz)
    gyro = bool(found.traces) and found.traces[0].channel == "rate"
    channel = units["rate"] if gyro else units["rate"].removesuffix("/s")
    both = diagnose(found.traces, sensor, floors, (units["torque"], channel))
    if not both:
        return found
    return replace(found, residual_before=both[0], residual_after=both[1] if found.after is not None else None)


def _over(value: float | None, floor: float) -> float | None:
    return None if value is None or not floor > 0.0 else value / floor


def _run(trace: RunTraces, sensor: Sensor, torque: bool, number: int) -> RunResiduals:
    """One run with both models' residuals and the draws of noise as columns."""
    time = trace.time_s - trace.time_s[0]
    step = float(time[-1]) / (len(time) - 1)
    use = settled(trace.keep, step, sensor.lowpass_hz if torque else None)
    if torque:
        columns = [np.asarray(trace.torque_residual_before), np.asarray(trace.torque_residual_after)]
    else:
        columns = [trace.measured - trace.simulated_before, trace.measured - trace.simulated_after]
    use &= np.all(np.isfinite(columns), axis=0)
    rng = np.random.default_rng([17, number])
    for _ in range(DRAWS):
        white = sensor.noise * rng.standard_normal(len(time))
        columns.append(as_torque(white, trace.channel, step, sensor) if torque else white)
    left = np.column_stack([np.where(use, c, 0.0) for c in columns])
    known = trace.torque_nm if trace.torque_nm is not None else np.zeros(len(time))
    thin = max(1, int(1.0 / (OVERSAMPLED * sensor.lowpass_hz * step))) if torque and sensor.lowpass_hz else 1
    angle, rate = _by_model(trace, step)
    return RunResiduals(
        thin * step, trace.angle_rad[::thin], trace.rate_rad_s[::thin], known[::thin], angle[::thin], rate[::thin],
        use[::thin], left[::thin],
    )  # fmt: skip


def _by_model(trace: RunTraces, step_s: float) -> tuple[Array, Array]:
    """Angle and rate of the final model in free run; zero where it strays too far to tell what was."""
    found = trace.simulated_after
    moves = float(np.std(trace.measured))
    if not np.all(np.isfinite(found)) or not np.std(trace.measured - found) < ASTRAY * moves:
        return np.zeros(len(found)), np.zeros(len(found))
    if trace.channel == "angle":
        return found, np.gradient(found, step_s)
    angle = step_s * np.cumsum(found)
    return angle - np.linspace(0.0, angle[-1] - angle[0], len(angle)), found


def as_torque(noise: Array, channel: str, step_s: float, sensor: Sensor) -> Array:
    """What noise of the measured channel looks like in the torque residual, (n,)."""
    platform, n = sensor.platform, len(noise)
    assert platform is not None
    if sensor.lowpass_hz:
        noise = low_pass(noise, sensor.lowpass_hz, step_s)
    angle = step_s * np.cumsum(noise) if channel == "rate" else noise
    rate = noise if channel == "rate" else np.gradient(noise, step_s)
    torque = (
        platform.inertia_kg_m2 * np.gradient(rate, step_s)
        + platform.damping_nm_s_rad * rate
        + platform.stiffness_nm_rad * angle
    )
    if channel == "rate":
        ramp = np.linspace(-1.0, 1.0, n)
        torque = torque - np.mean(torque) - ramp * (ramp @ torque) / (ramp @ ramp)
    return np.asarray(torque)


def _natural_hz(sensor: Sensor) -> float:
    platform = sensor.platform
    if platform is None or platform.inertia_kg_m2 <= 0.0:
        return 0.0
    return float(np.sqrt(max(platform.stiffness_nm_rad, 0.0) / platform.inertia_kg_m2) / (2.0 * np.pi))


def _shares(power: Array, total: Array) -> tuple[Share, Share]:
    """Shares of both models from powers (2 + draws,), each with what the draws show at most."""
    draws = power[2:]
    chance = float(np.mean(draws) + CHANCE_SIGMAS * np.std(draws))
    first, second = (Share(float(np.clip(power[i] / total[i], 0.0, 1.0)), max(chance, 0.0) / total[i]) for i in (0, 1))
    return first, second


def _harmonics(found: Repeated, i: int) -> Harmonics:
    total = found.total
    own, odd, even = ((_shares(p, total)[i] if found.parted else None) for p in (found.own, found.odd, found.even))
    repeats = _shares(found.own + found.odd + found.even, total)[i]
    orders = {k: float(p[i] / total[i]) for k, p in found.orders.items() if p[i] > MIN_HARMONIC_SHARE * total[i]}
    return Harmonics(repeats, own, odd, even, orders)
