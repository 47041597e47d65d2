"""Noise of the current sensor moves no platform, and must not pass for inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.pipeline import identify
from identify.signals.torque_noise import quieter
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import TRUTH, sine_run, traces_of, white

SETS = ((104.0, 3.0), (67.0, 6.0))


def noisy(share: float) -> tuple[Run, ...]:
    """Sets whose torque was read with white noise, a share of its amplitude."""
    runs = []
    for seed, (torque_nm, hertz) in enumerate(SETS):
        run = sine_run(torque_nm, hertz, seed=seed)
        assert run.torque_nm is not None
        runs.append(replace(run, torque_nm=run.torque_nm + white(len(run.torque_nm), share * torque_nm, 50 + seed)))
    return tuple(runs)


def test_noise_goes_and_the_torque_stays() -> None:
    found = quieter(traces_of(Recording(noisy(0.02))))
    assert found is not None
    traces, cutoff_hz = found
    assert 6.0 < cutoff_hz < 100.0
    for trace, (torque_nm, hertz) in zip(traces, SETS, strict=True):
        assert trace.torque is not None
        true = torque_nm * np.sin(2.0 * np.pi * hertz * trace.torque.time_s)
        assert np.std((trace.torque.torque_nm - true)[300:-300]) < 0.4 * 0.02 * torque_nm


def test_a_torque_without_noise_stays_as_it_is() -> None:
    assert quieter(traces_of(Recording(noisy(0.0)))) is None


def test_a_commanded_torque_is_known_and_stays_as_it_is() -> None:
    held = tuple(replace(run, torque_hold="zero_order") for run in noisy(0.02))
    assert quieter(traces_of(Recording(held))) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "offered"),
    [
        (0.01, ("coulomb_friction", "torque_delay", "cubic_stiffness", "flexible_mode")),
        pytest.param(0.01, None, marks=pytest.mark.slow),  # the whole library
        pytest.param(0.05, None, marks=pytest.mark.slow),
    ],
)
def test_noise_in_the_recorded_torque_does_not_pass_for_inertia(share: float, offered: tuple[str, ...] | None) -> None:
    """As it was recorded the likelihood finds five times the inertia."""
    found = identify(Recording(noisy(share)), Platform(*TRUTH), IdentifyConfig(candidates=offered))
    assert found.verdict.effects == ()
    assert found.accepted, found.reasons
    assert found.final.parameters["inertia"].value == pytest.approx(TRUTH[0], rel=0.02)
    assert found.final.parameters["stiffness"].value == pytest.approx(TRUTH[2], rel=0.01)
    assert "noise that the platform does not follow" in found.holdout_note
