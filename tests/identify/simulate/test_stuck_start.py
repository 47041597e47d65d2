"""Where a run began that dry friction held beside the spring's rest."""

from __future__ import annotations

import numpy as np
import pytest

from identify.estimate.output_error import refine
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from identify.simulate.all_runs import shots_for
from identify.simulate.stuck_start import holding_nm
from rig.dynamics import Equations
from rig.platform import Platform
from tests.identify.simulated import NOISE_RAD_S, TRUTH, sine_run

LEVEL_NM = 1.2
KNOWN = {
    ("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2],
    ("coulomb_friction", "level"): LEVEL_NM, ("sensor_lag", "time"): 5e-4,
}  # fmt: skip
STRUCTURE = Structure(effects=("coulomb_friction", "sensor_lag"))


@pytest.mark.parametrize("share", [-0.9, -0.4, 0.0, 0.55, 0.9])
def test_a_run_that_swells_slowly_from_a_standstill_is_begun_in_the_right_minimum(share: float) -> None:
    stuck = share * LEVEL_NM / TRUTH[2]
    hidden = {"coulomb_friction": {"level": LEVEL_NM}, "sensor_lag": {"time": 5e-4}}
    trace = prepare(sine_run(42.0, 9.0, effects=hidden, soft_s=1.5, begin_rad=stuck, bias=0.005))
    found = refine([trace], STRUCTURE, KNOWN, None, 12, fixed=tuple(KNOWN))
    assert found.sigma == pytest.approx(NOISE_RAD_S, rel=0.05)
    assert found.shots[0].starts[0, 0] == pytest.approx(stuck, abs=0.03 * LEVEL_NM / TRUTH[2])


def test_a_run_that_begins_in_motion_keeps_its_start() -> None:
    run = sine_run(42.0, 9.0, effects={"coulomb_friction": {"level": LEVEL_NM}, "sensor_lag": {"time": 5e-4}})
    assert run.rate_rad_s is not None
    late = slice(1000, None)
    moving = prepare(
        type(run)(
            run.name, run.time_s[late], run.valid[late], rate_rad_s=run.rate_rad_s[late],
            torque_time_s=run.torque_time_s, torque_nm=run.torque_nm, frequency_hz=9.0,
        )
    )  # fmt: skip
    (shots,) = shots_for([moving], STRUCTURE, tuple(KNOWN), np.array(list(KNOWN.values())), None, None, None, False)
    assert shots.starts[0, 0] == 0.0


@pytest.mark.parametrize(
    ("effects", "holds"),
    [
        ({"coulomb_friction": {"level": 1.2}}, 1.2),
        ({"stribeck_friction": {"coulomb": 1.2, "static": 2.4, "speed": 0.08}}, 2.4),
        ({"load_dependent_friction": {"factor": 0.1}}, 0.0),
        ({"cubic_stiffness": {"factor": 100.0}}, 0.0),
    ],
)
def test_what_holds_a_platform_at_rest_is_what_its_dry_friction_does_there(
    effects: dict[str, dict[str, float]], holds: float
) -> None:
    assert holding_nm(Equations(Platform(*TRUTH, effects))) == pytest.approx(holds)
