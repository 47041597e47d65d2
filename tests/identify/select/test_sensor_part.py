"""A sensor's low-pass beside a search in torque: late there, put back afterwards."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from identify.model.structure import Structure
from identify.select.lags import SensorPart

DELAY = ("torque_delay", "delay")
TIME = ("sensor_lag", "time")
INERTIA = ("inertia",)


def model(*effects: str, **values: float) -> Any:
    known = {"delay": DELAY, "time": TIME, "inertia": INERTIA}
    return SimpleNamespace(structure=Structure(effects=effects), values={known[k]: v for k, v in values.items()})


def regression(by_gyro: bool) -> Any:
    return SimpleNamespace(by_gyro=by_gyro, solve=lambda structure, shapes: (structure.effects, shapes))


def test_a_gyros_low_pass_makes_the_motion_late_in_torque() -> None:
    part = SensorPart.of(model("sensor_lag", time=0.002), Structure())
    assert part.begun(regression(True), {}) == (("torque_delay",), {"torque_delay": (0.002,)})
    assert part.begun(regression(False), {}) == ((), {})


def test_a_declared_delay_is_late_by_both() -> None:
    part = SensorPart.of(
        model("torque_delay", "sensor_lag", delay=0.003, time=0.002), Structure(effects=("torque_delay",))
    )
    effects, shapes = part.begun(regression(True), {"torque_delay": (0.001,)})
    assert effects == ("torque_delay",)
    assert shapes["torque_delay"] == pytest.approx((0.003,))


@pytest.mark.parametrize("declared", [(), ("torque_delay",)])
def test_the_low_pass_is_put_back_in_place_of_the_delay_that_stood_for_it(declared: tuple[str, ...]) -> None:
    """A delay that is declared stays, as the likelihood has it."""
    part = SensorPart.of(model(*declared, "sensor_lag", delay=0.003, time=0.002), Structure(effects=declared))
    structure, values = part.put_back(model("torque_delay", "coulomb_friction", delay=0.005, inertia=1.0))
    assert set(structure.effects) == {*declared, "coulomb_friction", "sensor_lag"}
    assert values == {INERTIA: 1.0, TIME: 0.002, **({DELAY: 0.003} if declared else {})}


def test_without_a_low_pass_a_model_found_in_torque_stays_as_it_is() -> None:
    part = SensorPart.of(model("coulomb_friction"), Structure())
    structure, values = part.put_back(model("torque_delay", delay=0.005))
    assert (structure.effects, values) == (("torque_delay",), {DELAY: 0.005})
