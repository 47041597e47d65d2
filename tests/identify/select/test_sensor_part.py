"""A sensor's low-pass beside a search in torque: a gyro's is in the motion that the torque is compared with."""

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


def test_the_torque_is_taken_behind_a_gyros_low_pass_as_the_likelihood_has_it() -> None:
    part = SensorPart.of(model("sensor_lag", time=0.002), Structure())
    assert part.begun(regression(True), {}) == (("sensor_lag",), {"sensor_lag": (0.002,)})
    assert part.begun(regression(False), {}) == ((), {})


def test_a_declared_delay_stays_beside_the_low_pass() -> None:
    part = SensorPart.of(
        model("torque_delay", "sensor_lag", delay=0.003, time=0.002), Structure(effects=("torque_delay",))
    )
    effects, shapes = part.begun(regression(True), {"torque_delay": (0.001,)})
    assert effects == ("torque_delay", "sensor_lag")
    assert shapes == {"torque_delay": (0.001,), "sensor_lag": (0.002,)}


@pytest.mark.parametrize("declared", [(), ("torque_delay",)])
@pytest.mark.parametrize("by_gyro", [True, False])
def test_a_model_found_in_torque_has_the_sensors_part_as_the_likelihood_has_it(
    declared: tuple[str, ...], by_gyro: bool
) -> None:
    """A delay that is declared stays, as the likelihood has it."""
    part = SensorPart.of(model(*declared, "sensor_lag", delay=0.003, time=0.002), Structure(effects=declared))
    seen = ("sensor_lag",) if by_gyro else ()
    structure, values = part.put_back(model(*declared, *seen, "coulomb_friction", inertia=1.0))
    assert set(structure.effects) == {*declared, "coulomb_friction", "sensor_lag"}
    assert len(structure.effects) == len(set(structure.effects))
    assert values == {INERTIA: 1.0, TIME: 0.002, **({DELAY: 0.003} if declared else {})}


def test_without_a_low_pass_a_model_found_in_torque_stays_as_it_is() -> None:
    part = SensorPart.of(model("coulomb_friction"), Structure())
    structure, values = part.put_back(model("torque_delay", delay=0.005))
    assert (structure.effects, values) == (("torque_delay",), {DELAY: 0.005})
