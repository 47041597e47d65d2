"""The frequency response of a model against textbook forms."""

from __future__ import annotations

import numpy as np
import pytest

from identify.frequency.model_response import Size, linear_response
from rig import effects
from rig.channels import Channel
from rig.platform import Platform

F = np.geomspace(0.3, 60.0, 60)
S = 2j * np.pi * F
SIZE = Size(0.1, 2.0, 50.0)
MODE = (2 * np.pi * 12.0) ** 2 + 2 * 0.02 * (2 * np.pi * 12.0) * S
CLOSED = {
    "torque_delay": ({"delay": 1.5e-3}, np.exp(-1.5e-3 * S), 0.0),
    "actuator_lag": ({"time": 3e-3}, 1.0 / (1.0 + 3e-3 * S), 0.0),
    "sensor_lag": ({"time": 0.3}, 1.0 / (1.0 + 0.3 * S), 0.0),
    "creep": ({"stiffness": 30.0, "time": 0.05}, 1.0, 30.0 * 0.05 * S / (1.0 + 0.05 * S)),
    "flexible_mode": ({"inertia": 3e-3, "frequency": 12.0, "ratio": 0.02}, 1.0, 3e-3 * MODE * S**2 / (S**2 + MODE)),
    "torque_offset": ({"level": 1.0}, 1.0, 0.0),
    "torque_scale": ({"scale": 1.3}, 1.3, 0.0),
    "rate_bias": ({"bias": 0.1}, 1.0, 0.0),
}


@pytest.mark.parametrize("name", CLOSED)
def test_a_linear_effect_stands_in_the_response_as_the_textbook_has_it(name: str) -> None:
    values, drive, load = CLOSED[name]
    found, left_out = linear_response(Platform(0.02, 0.045, 677.3, {name: values}), F, SIZE)
    expected = drive * S / (0.02 * S**2 + 0.045 * S + 677.3 + load)
    assert left_out == ()
    assert np.max(np.abs(found / expected - 1.0)) < 2e-4


@pytest.mark.parametrize("name", sorted(set(effects.names()) - set(CLOSED)))
def test_what_depends_on_amplitude_or_time_stands_in_no_line_and_is_named(name: str) -> None:
    values = {p.name: 0.013 + max(p.low, 0.0) for p in effects.get(name).parameters}
    found, left_out = linear_response(Platform(0.02, 0.045, 677.3, {name: values}), F, SIZE)
    assert left_out == (name,)
    assert found == pytest.approx(S / (0.02 * S**2 + 0.045 * S + 677.3))


def test_what_follows_a_measured_channel_has_no_response_of_its_own() -> None:
    effects.declare_channels([Channel("winding", "temperature")])
    for name in effects.of_channel("winding"):
        given = {p.name: 0.01 for p in effects.get(name).parameters}
        found, left_out = linear_response(Platform(0.02, 0.045, 677.3, {name: given}), F, SIZE)
        assert left_out == (name,)
        assert found == pytest.approx(S / (0.02 * S**2 + 0.045 * S + 677.3))
