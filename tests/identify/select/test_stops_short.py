"""A right model that stops short of the sensor's noise, because a small torque was not recorded, is not thrown away."""

from __future__ import annotations

from dataclasses import replace

import pytest

from identify.pipeline import identify
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording
from tests.identify.simulated import TRUTH, sine_run, white

SETS = ((67.0, 6.0), (111.0, 1.0), (104.0, 3.0))
FEW = ("backlash", "coulomb_friction", "cubic_stiffness")
MORE = (*FEW, "cogging", "unbalance")


@pytest.mark.slow
@pytest.mark.parametrize(("share", "offered"), [(0.003, MORE), (0.01, MORE), (0.01, FEW)])
def test_an_effect_is_named_beside_a_small_torque_that_nobody_recorded(share: float, offered: tuple[str, ...]) -> None:
    runs = []
    for seed, (torque_nm, hertz) in enumerate(SETS):
        run = sine_run(torque_nm, hertz, seed=seed, effects={"backlash": {"half_gap": 1e-3}}, duration_s=1.5)
        assert run.torque_nm is not None
        runs.append(replace(run, torque_nm=run.torque_nm + white(len(run.torque_nm), share * torque_nm, 100 + seed)))
    found = identify(Recording(tuple(runs)), Platform(*TRUTH), IdentifyConfig(candidates=offered))
    assert found.verdict.effects == ("backlash",)
    assert found.accepted, found.reasons
    assert found.final.parameters["stiffness"].value == pytest.approx(TRUTH[2], rel=0.002)
    assert found.disturbance is not None and found.disturbance.relative < share
