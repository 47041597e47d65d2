"""A mode with little damping and lost samples: along the measured motion its torque is mostly errors of that."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identify.model.structure import Structure
from identify.pipeline import identify
from identify.select import field_search
from rig.config.identify import IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Recording, Run

JCK = (7.5, 10.0, 0.0)
MODE = {"inertia": 5.4, "frequency": 6.43, "ratio": 0.011}
STEP_S, SECONDS, NOISE_RAD = 4e-3, 30.0, 1.5e-5
TONES_HZ = (0.13, 0.31, 0.7, 1.3, 2.1, 2.6)


def run(number: int) -> Run:
    """A multisine below the mode, with a torque beside it that nobody recorded, and two gaps of a quarter of a second.

    What is put into a gap sets the mode swinging, and it swings for seconds.
    """
    rng = np.random.default_rng(number)
    time = STEP_S * np.arange(round(SECONDS / STEP_S))
    torque = sum(40.0 * np.sin(2.0 * np.pi * (f * time + rng.random())) for f in TONES_HZ)
    slow = np.interp(time, np.arange(0.0, SECONDS + 2.0, 2.0), rng.standard_normal(int(SECONDS / 2.0) + 1))
    felt = torque + 0.3 * slow + 0.3 * rng.standard_normal(len(time))
    platform = Platform(*JCK, {"flexible_mode": MODE})
    motion = simulate(platform, time, TorqueSignal(time, felt, "zero_order"), start=(0.0, 0.0), substeps=16)
    angle = motion.angle_rad + NOISE_RAD * rng.standard_normal(len(time))
    read = np.ones(len(time), bool)
    for begin in rng.integers(200, len(time) - 200, 2):
        read[begin : begin + 60] = False
    return Run(
        f"run {number}", time, read, angle_rad=angle, torque_time_s=time, torque_nm=torque,
        torque_hold="zero_order",
    )  # fmt: skip


@pytest.mark.slow
def test_what_errors_of_the_motion_leave_in_torque_says_nothing_against_the_likelihood() -> None:
    recording = Recording(tuple(run(k) for k in range(3)))
    found = identify(recording, Platform(*JCK), IdentifyConfig())
    assert found.verdict.effects == ("flexible_mode",)
    assert found.accepted
    inertia = found.final.parameters["inertia"]
    assert inertia.value == pytest.approx(JCK[0], rel=5e-3)
    assert inertia.ci95[0] < JCK[0] < inertia.ci95[1]


@pytest.mark.parametrize("trusted", [True, False])
def test_no_final_fit_of_a_model_that_the_likelihood_found_asks_torque_where_that_shows_nothing(
    trusted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither of the whole model nor of what stays of it where a name is taken back."""

    def asked(*of: Any) -> float:
        raise LookupError

    model: Any = SimpleNamespace(structure=Structure(effects=("flexible_mode",)), sigma=1.0, values={})
    split: Any = SimpleNamespace(everything=[])
    regression: Any = SimpleNamespace(left_by=asked)
    begun = (regression, model, (model, model), [], split, trusted, True)
    monkeypatch.setattr(field_search, "as_final", lambda *of: SimpleNamespace(values={}))
    if trusted:
        assert field_search._final(*begun).values == {}
    else:
        with pytest.raises(LookupError):
            field_search._final(*begun)
