"""The final fit beside a disturbance: how torque and readings lie to each other within a sample is left open."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identify.estimate.final_fit import FinalFit
from identify.likelihood import by_prediction_error
from identify.likelihood.by_prediction_error import _beside_shift, as_final, fitted_on_all
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from identify.signals.trace import Trace
from rig.dynamics import TorqueSignal, simulate
from rig.platform import TERMS, Platform
from rig.recording.run import Run

JCK = (0.02, 0.05, 2.0)
STEP_S = 2e-3
EARLY = 0.1  # of a sample: the torque acts that much before it is said to


@cache
def runs(early: float, seed: int = 0) -> tuple[Trace, ...]:
    """Two runs with a torque that nobody recorded; the encoder's reading is as good as exact."""
    out = []
    for k, tones_hz in enumerate(((1.3, 4.1, 11.0), (2.2, 6.3, 14.0))):
        rng = np.random.default_rng([seed, k])
        time = STEP_S * np.arange(5001)
        fine = np.arange(0.0, time[-1] + 1.0, STEP_S / 4.0)
        told = np.sum([np.sin(2.0 * np.pi * f * fine) for f in tones_hz], axis=0)
        unrecorded = np.interp(fine, time, 0.01 * rng.standard_normal(len(time)))
        acts = TorqueSignal(fine - early * STEP_S, told)
        shaft = TorqueSignal(fine, np.interp(fine, acts.time_s, told) + unrecorded)
        angle = simulate(Platform(*JCK), time, shaft, start=(0.0, 0.0)).angle_rad + 1e-6 * rng.standard_normal(
            len(time)
        )
        run = Run(
            f"run {k}", time, np.ones(len(time), bool), angle_rad=angle, torque_time_s=time, torque_nm=told[::4][:5001]
        )
        out.append(prepare(run, k))
    return tuple(one_noise(out, False))


def fitted(traces: tuple[Trace, ...], *effects: str) -> FinalFit:
    start = {(k,): v for k, v in zip(TERMS, JCK, strict=True)}
    every = [t.keep for t in traces]
    if effects:
        start[("torque_delay", "delay")] = 1e-4
    return as_final(*fitted_on_all(traces, Structure().plus(*effects), start, every), traces, every)


def sigmas_off(found: FinalFit) -> dict[str, float]:
    return {k: (found.values[(k,)] - v) / found.std_error((k,)) for k, v in zip(TERMS, JCK, strict=True)}


def test_a_tenth_of_a_sample_does_not_move_the_damping() -> None:
    found = fitted(runs(EARLY))
    plain = (found.fit.values[("damping",)] - JCK[1]) / found.fit.std_error(("damping",))
    assert abs(plain) > 5.0
    assert all(abs(off) < 3.0 for off in sigmas_off(found).values())


@pytest.mark.slow
def test_without_a_shift_the_numbers_stay_and_the_intervals_hold() -> None:
    assert all(abs(off) < 3.0 for off in sigmas_off(fitted(runs(0.0))).values())
    moved, spread = _beside_shift(
        *fitted_on_all(runs(0.0), Structure(), {(k,): 1.0 for k in TERMS}, [t.keep for t in runs(0.0)])
    )
    assert np.all(np.abs(moved) < 4.0 * np.sqrt(np.diag(spread)))


def test_a_torque_that_is_held_and_a_model_with_a_delay_leave_nothing_open() -> None:
    held = tuple(replace(t, torque=replace(t.torque, hold="zero_order"), _series={}) for t in runs(0.0) if t.torque)
    start = {(k,): v for k, v in zip(TERMS, JCK, strict=True)}
    for traces, structure in ((held, Structure()), (runs(0.0), Structure().plus("torque_delay"))):
        problem, fit = fitted_on_all(traces, structure, start, [t.keep for t in traces])
        moved, spread = _beside_shift(problem, fit)
        assert not np.any(moved)
        assert not np.any(spread)


def test_a_motion_that_tells_nothing_of_it_leaves_half_a_sample_open() -> None:
    """One slow tone: damping and a delay are one, and the recording's own instants are all that is known."""
    time = STEP_S * np.arange(5001)
    torque = np.sin(2.0 * np.pi * 0.8 * time)
    noise = 0.1 * np.random.default_rng(4).standard_normal(len(time))
    motion = simulate(Platform(*JCK), time, TorqueSignal(time, torque + noise), start=(0.0, 0.0))
    run = Run(
        "one tone", time, np.ones(len(time), bool), angle_rad=motion.angle_rad, torque_time_s=time, torque_nm=torque
    )
    traces = tuple(one_noise([prepare(run, 0)], False))
    problem, fit = fitted_on_all(
        traces, Structure(), {(k,): v for k, v in zip(TERMS, JCK, strict=True)}, [traces[0].keep]
    )
    _, spread = _beside_shift(problem, fit)
    late = JCK[2] - JCK[0] * (2.0 * np.pi * 0.8) ** 2  # what a delay of a second does to the damping at this tone
    assert np.sqrt(spread[1, 1]) == pytest.approx(abs(late) * STEP_S / np.sqrt(12.0), rel=0.3)


def test_no_number_is_moved_out_of_its_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A friction that is nearly none would become negative, and no platform has that."""
    traces = runs(0.0)
    every = [t.keep for t in traces]
    start = {**{(k,): v for k, v in zip(TERMS, JCK, strict=True)}, ("coulomb_friction", "level"): 1e-3}
    problem, fit = fitted_on_all(traces, Structure().plus("coulomb_friction"), start, every)
    far = np.where([n == ("coulomb_friction", "level") for n in fit.names], -1.0, 0.0)
    monkeypatch.setattr(by_prediction_error, "_beside_shift", lambda *_: (far, np.zeros((len(far), len(far)))))
    assert as_final(problem, fit, traces, every).values["coulomb_friction", "level"] == 0.0
