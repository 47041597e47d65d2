"""A stiffness, a damping or a drive that something changes at a frequency of its own is no noise of the torque."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identify.conclude.next_steps import next_steps
from identify.conclude.verdict import residual_torque_sentence
from identify.diagnose.disturbance import disturbance_of
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.runs.holdout import split
from rig.config.identify import IdentifyConfig
from rig.recording.run import Recording, Run
from tests.identify.simulated import DECLARED, NOISE_RAD_S, TRUTH, traces_of

PULSE_HZ = 3.7
TONES_HZ = (0.6, 1.7, 4.3, 7.9)


def run_with(depth: dict[str, float], number: int, pulse_hz: float = PULSE_HZ) -> Run:
    return _run_with(*next(iter(depth.items()), ("", 0.0)), number, pulse_hz=pulse_hz)


@cache
def _run_with(on: str, depth: float, number: int, duration_s: float = 8.0, pulse_hz: float = PULSE_HZ) -> Run:
    """A multisine at 1 kHz on a platform of which a share of something pulsates, at another phase in every run."""
    j, c, k = TRUTH
    steps = round(duration_s * 1000)
    t = np.arange(2 * steps + 1) * 0.5e-3
    swell = np.minimum(t / 0.5, 1.0)
    moment = 30.0 * swell * sum(np.sin(2 * np.pi * f * t + 1.3 * i + number) for i, f in enumerate(TONES_HZ))
    wave = np.sin(2 * np.pi * pulse_hz * t + 2.0 * number)
    spring, drag, gain = (
        of * (1.0 + (depth if on == each else 0.0) * wave) for each, of in (("angle", k), ("rate", c), ("torque", 1.0))
    )
    angle = rate = 0.0
    rates = np.zeros(steps + 1)
    h = 1e-3

    def slope(i: int, th: float, w: float) -> tuple[float, float]:
        return w, (gain[i] * moment[i] - drag[i] * w - spring[i] * th) / j

    for n in range(steps):
        a1, b1 = slope(2 * n, angle, rate)
        a2, b2 = slope(2 * n + 1, angle + 0.5 * h * a1, rate + 0.5 * h * b1)
        a3, b3 = slope(2 * n + 1, angle + 0.5 * h * a2, rate + 0.5 * h * b2)
        a4, b4 = slope(2 * n + 2, angle + h * a3, rate + h * b3)
        angle += h * (a1 + 2 * a2 + 2 * a3 + a4) / 6
        rate += h * (b1 + 2 * b2 + 2 * b3 + b4) / 6
        rates[n + 1] = rate
    time = np.arange(round(duration_s * 1000) + 1) * 1e-3
    read = rates + NOISE_RAD_S * np.random.default_rng(number).standard_normal(len(time))
    return Run(
        f"run {number}", time, np.ones(len(time), bool), rate_rad_s=read, torque_time_s=time,
        torque_nm=moment[::2],
    )  # fmt: skip


# Of several runs the stiffness is told apart least easily: the others are slow there.
EACH = (("angle", 0.06, "stiffness"), ("rate", 0.9, "damping"), ("torque", 0.05, "gain of the drive"))


@pytest.mark.parametrize(
    ("on", "depth", "what", "runs"),
    [
        *((*each, 1) for each in EACH),
        (*EACH[0], 3),
        *(pytest.param(*each, 3, marks=pytest.mark.slow) for each in EACH[1:]),
    ],
)
def test_what_pulsates_is_told_with_its_frequency(on: str, depth: float, what: str, runs: int) -> None:
    traces = traces_of(Recording(tuple(run_with({on: depth}, i) for i in range(runs))))
    regression = TorqueRegression(traces, split(traces, "auto"), 30.0, scale_of(traces, TRUTH, ()))
    fit = regression.solve(Structure(), {})
    left = disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), "N*m")
    (part,) = left.depends_on
    assert (part.on, part.wave_on) == ("time", on)
    assert part.wave_hz == pytest.approx(PULSE_HZ, abs=0.07)
    assert part.false_alarm < 1e-4
    said = residual_torque_sentence(left, "rotary")
    assert f"depends on the time, as if something changed the {what} at 3.7" in said


def test_what_pulsates_faster_than_the_band_is_told_by_what_it_makes_of_the_motion() -> None:
    cutoff_hz, pulse_hz = 10.0, 13.1
    traces = traces_of(Recording((run_with({"angle": 0.06}, 0, pulse_hz),)))
    regression = TorqueRegression(traces, split(traces, "auto"), cutoff_hz, scale_of(traces, TRUTH, ()))
    fit = regression.solve(Structure(), {})
    (part,) = disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), "N*m").depends_on
    assert (part.on, part.wave_on) == ("time", "angle")
    assert part.wave_hz == pytest.approx(pulse_hz, abs=0.07)


def test_a_curve_over_the_angle_that_takes_a_quarter_of_it_does_not_hide_it() -> None:
    traces = traces_of(Recording((run_with({"angle": 0.3}, 0),)))
    regression = TorqueRegression(traces, split(traces, "auto"), 30.0, scale_of(traces, TRUTH, ()))
    fit = regression.solve(Structure(), {})
    wave, curve = disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), "N*m").depends_on
    assert (wave.on, wave.wave_on) == ("time", "angle")
    assert wave.wave_hz == pytest.approx(PULSE_HZ, abs=0.07)
    assert (curve.on, curve.wave_on) == ("angle", "")
    assert curve.relative < 0.6 * wave.relative


@pytest.mark.parametrize("runs", [1, 3])
def test_noise_of_the_torque_does_not_pulsate(runs: int) -> None:
    clean = [run_with({}, i) for i in range(runs)]
    rng = np.random.default_rng(5)
    noisy = tuple(
        Run(
            r.name, r.time_s, r.valid, rate_rad_s=r.rate_rad_s, torque_time_s=r.torque_time_s,
            torque_nm=r.torque_nm + 3.0 * rng.standard_normal(len(r.time_s)),
        ) for r in clean
    )  # fmt: skip
    traces = traces_of(Recording(noisy))
    regression = TorqueRegression(traces, split(traces, "auto"), 30.0, scale_of(traces, TRUTH, ()))
    fit = regression.solve(Structure(), {})
    assert disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), "N*m").depends_on == ()


@pytest.mark.slow
def test_a_spring_that_something_shakes_is_not_accepted_and_the_frequency_is_the_next_step() -> None:
    found = identify(Recording((run_with({"angle": 0.3}, 0),)), DECLARED, IdentifyConfig())
    assert not found.accepted
    assert found.disturbance is not None
    assert math.isclose(
        max(found.disturbance.depends_on, key=lambda d: d.relative).wave_hz or 0.0, PULSE_HZ, abs_tol=0.07
    )
    assert "changed the stiffness at 3.7" in residual_torque_sentence(found.disturbance, "rotary")
    found = replace(found, verdict=replace(found.verdict, tells_apart=""))  # it may take a sideband for a tone
    steps = next_steps(found)
    assert any("changes the stiffness at 3.7" in step for step in steps), steps
