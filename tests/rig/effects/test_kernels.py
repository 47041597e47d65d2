"""Every compiled kernel against its equation, written once more in plain Python."""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import c_double
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from rig import effects
from rig.arrays import Array
from rig.dynamics.filters import run_filter
from rig.dynamics.native import addresses
from rig.effects import Effect, Place
from tests.rig.effects.values import VALUES

J, C, K = 0.02, 0.045, 677.3
AT_THE_SHAFT = [n for n in effects.names() if effects.get(n).place in (Place.LOAD, Place.FRICTION)]
STEP_S = 1e-3

Point = SimpleNamespace  # th, w, t, m, z and the parameters, as the equations of the docs name them
Answer = tuple[float, tuple[float, ...]]


def _hysteresis(x: Point) -> Answer:
    knee = abs(x.z[0]) ** x.exponent * (x.share * math.copysign(1, x.w * x.z[0]) + 1 - x.share)
    return x.level * x.z[0], (x.w / x.yield_angle * (1 - knee),)


def _flexible_mode(x: Point) -> Answer:
    own = 2 * math.pi * x.frequency
    pull = own**2 * (x.th - x.z[0]) + 2 * x.ratio * own * (x.w - x.z[1])
    return x.inertia * pull, (x.z[1], pull)


EQUATIONS: dict[str, Callable[[Point], Answer]] = {
    "coulomb_friction": lambda x: (x.level, ()),
    "stribeck_friction": lambda x: (x.coulomb + (x.static - x.coulomb) * math.exp(-((x.w / x.speed) ** 2)), ()),
    "presliding_friction": lambda x: (x.level * x.z[0], ((x.w - abs(x.w) * x.z[0]) / x.displacement,)),
    "load_dependent_friction": lambda x: (x.factor * abs(x.m), ()),
    "quadratic_damping": lambda x: (x.factor * x.w * abs(x.w), ()),
    "directional_damping": lambda x: (x.step * x.w if x.w > 0 else 0.0, ()),
    "cubic_stiffness": lambda x: (x.factor * x.th**3, ()),
    "quadratic_stiffness": lambda x: (x.factor * x.th**2, ()),
    "bilinear_stiffness": lambda x: (x.step * x.th if x.th > 0 else 0.0, ()),
    "backlash": lambda x: (-K * float(np.clip(x.th, -x.half_gap, x.half_gap)), ()),
    "hysteresis": _hysteresis,
    "creep": lambda x: (x.stiffness * (x.th - x.z[0]), ((x.th - x.z[0]) / x.time,)),
    "stiffness_drift": lambda x: (x.slope * x.t * x.th, ()),
    "unbalance": lambda x: (x.sine * math.sin(x.th) + x.cosine * math.cos(x.th), ()),
    "cogging": lambda x: (x.sine * math.sin(x.order * x.th) + x.cosine * math.cos(x.order * x.th), ()),
    "torque_offset": lambda x: (x.level, ()),
    "flexible_mode": _flexible_mode,
    "periodic_disturbance": lambda x: (
        x.sine * math.sin(2 * math.pi * x.frequency * x.t) + x.cosine * math.cos(2 * math.pi * x.frequency * x.t), ()
    ),
}  # fmt: skip


def call(effect: Effect, x: Point, values: tuple[float, ...]) -> Answer:
    """The compiled kernel at one point: torque and state derivatives."""
    size = max(1, effect.states)
    state, derivative = (c_double * size)(*x.z), (c_double * size)()
    p = (c_double * (3 + len(values)))(J, C, K, *values)
    return effect.kernel.ctypes(x.th, x.w, x.t, x.m, state, derivative, p), tuple(derivative[: effect.states])


def points(effect: Effect, count: int = 40) -> list[Point]:
    """Random points; a friction kernel is handed the size of the rate."""
    rng = np.random.default_rng(7)
    out = []
    for th, w, t, m in rng.uniform(-1, 1, (count, 4)) * (0.17, 7.0, 5.0, 100.0) + (0, 0, 5.0, 0):
        rate = abs(w) if effect.place is Place.FRICTION else w
        out.append(Point(th=th, w=rate, t=t, m=m, z=tuple(rng.uniform(-0.9, 0.9, effect.states))))
    return out


def filtered(name: str, x: Array, values: tuple[float, ...], step_s: float = STEP_S) -> Array:
    """Samples behind one filter kernel, the first of them taken to have stood for ever."""
    effect = effects.get(name)
    size = effect.filter_states(step_s, values) if effect.filter_states else 0
    out = np.array(x, dtype=float)
    ends = np.array([0, size]), np.array([0, len(values)])
    run_filter(addresses([effect.kernel]), out, step_s, np.zeros(size), ends[0], np.array(values), ends[1])
    return out


def test_every_effect_at_the_shaft_has_its_equation_here() -> None:
    assert set(EQUATIONS) == set(AT_THE_SHAFT)


@pytest.mark.parametrize("name", AT_THE_SHAFT)
def test_the_kernel_gives_what_the_equation_says(name: str) -> None:
    effect, given = effects.get(name), VALUES[name]
    for x in points(effect):
        torque, derivative = EQUATIONS[name](Point(**vars(x), **given))
        found, states = call(effect, x, effect.values(given))
        assert found == pytest.approx(torque, rel=1e-12, abs=1e-12)
        assert states == pytest.approx(derivative, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", AT_THE_SHAFT)
def test_the_torque_is_a_sum_of_its_linear_parameters_and_the_terms_it_leans_on(name: str) -> None:
    effect = effects.get(name)
    given = effect.values(VALUES[name])
    linear = [k for k, p in enumerate(effect.parameters) if p.linear]
    units = [tuple(0.0 if i in linear and i != k else v for i, v in enumerate(given)) for k in linear]
    units += [given] if effect.leans_on else []
    for x in points(effect, 10):
        whole, derivative = call(effect, x, given)
        parts = [call(effect, x, u) for u in units]
        assert sum(torque for torque, _ in parts) == pytest.approx(whole, rel=1e-12, abs=1e-12)
        assert all(d == pytest.approx(derivative, rel=1e-12) for _, d in parts), "a gain may not steer the state"


def test_backlash_leans_on_the_stiffness_and_on_nothing_else() -> None:
    effect = effects.get("backlash")
    x = Point(th=0.1, w=0.0, t=0.0, m=0.0, z=())
    p = (c_double * 4)(1.0, 1.0, 0.0, 0.01)
    assert effect.kernel.ctypes(x.th, x.w, x.t, x.m, (c_double * 1)(), (c_double * 1)(), p) == 0.0
    assert effect.leans_on == ("stiffness",)


def test_hysteresis_of_exponent_one_and_share_one_is_presliding_friction() -> None:
    bouc, dahl = effects.get("hysteresis"), effects.get("presliding_friction")
    for x in points(bouc):
        torque, (slope,) = call(bouc, x, (1.3, 0.01, 1.0, 1.0))
        assert (torque, slope) == pytest.approx((call(dahl, x, (1.3, 0.01))[0], call(dahl, x, (1.3, 0.01))[1][0]))


def test_stribeck_friction_with_equal_levels_is_coulomb_friction() -> None:
    stribeck, coulomb = effects.get("stribeck_friction"), effects.get("coulomb_friction")
    for x in points(stribeck):
        assert call(stribeck, x, (1.3, 1.3, 0.1))[0] == pytest.approx(call(coulomb, x, (1.3,))[0])


@pytest.mark.parametrize("delay_ms", [0.0, 0.3, 1.0, 1.5, 4.75, 20.0])
def test_a_delay_is_right_to_a_millionth_for_the_torques_of_a_bench(delay_ms: float) -> None:
    time = 1e-4 * np.arange(10_000)
    late = filtered("torque_delay", np.sin(2 * np.pi * 9 * time), (delay_ms * 1e-3,), 1e-4)
    settled = time > 0.03
    np.testing.assert_allclose(late[settled], np.sin(2 * np.pi * 9 * (time[settled] - delay_ms * 1e-3)), atol=1e-6)


def test_a_delay_of_whole_samples_moves_them_and_nothing_else() -> None:
    x = np.random.default_rng(1).standard_normal(200)
    np.testing.assert_allclose(filtered("torque_delay", x, (5e-3,))[5:], x[:-5], atol=1e-12)


@pytest.mark.parametrize("name", ["actuator_lag", "sensor_lag"])
@pytest.mark.parametrize("time_s", [1e-4, 3e-3, 0.1])
def test_a_lag_is_the_exact_answer_to_parabolas_through_three_samples(name: str, time_s: float) -> None:
    x = np.cumsum(np.random.default_rng(2).standard_normal(400))
    x -= x[0]
    parts = 200
    fine = STEP_S / parts * np.arange(399 * parts + 1)
    before = np.concatenate([[0.0], x])
    u = (np.arange(parts) + 1.0) / parts - 1.0  # of a step, from its begin at -1 to its end at 0
    bend = 0.5 * (before[2:] - 2.0 * before[1:-1] + before[:-2])
    pieces = x[1:, None] + (x[1:] - x[:-1])[:, None] * u + bend[:, None] * u * (u + 1.0)
    curve = np.concatenate([[0.0], pieces.ravel()])
    exact = signal.lsim(([1.0], [time_s, 1.0]), curve, fine, interp=True)[1][::parts]
    np.testing.assert_allclose(filtered(name, x, (time_s,)), exact, atol=2e-5)


@pytest.mark.parametrize("time_s", [1e-4, 3e-3, 0.1])
def test_a_lag_of_a_sine_is_right_to_a_part_in_ten_thousand_at_forty_samples_a_period(time_s: float) -> None:
    phase = 2 * np.pi / 40 * np.arange(8000)
    w_t = 2 * np.pi / 40 / STEP_S * time_s
    exact = (np.sin(phase) - w_t * np.cos(phase) + w_t * np.exp(-phase / w_t)) / (1 + w_t**2)
    error = filtered("actuator_lag", np.sin(phase), (time_s,)) - exact
    assert np.max(np.abs(error[2000:])) < 3e-4 * np.max(np.abs(exact[2000:]))


@pytest.mark.parametrize("name", ["actuator_lag", "sensor_lag"])
def test_a_lag_of_no_time_changes_nothing(name: str) -> None:
    x = np.random.default_rng(2).standard_normal(50)
    np.testing.assert_allclose(filtered(name, x, (0.0,)), x, atol=1e-15)


def test_saturation_clips_and_a_dead_zone_swallows() -> None:
    x = np.linspace(-5, 5, 11)
    np.testing.assert_allclose(filtered("torque_saturation", x, (2.5,)), np.clip(x, -2.5, 2.5))
    np.testing.assert_allclose(filtered("torque_deadzone", x, (2.0,)), np.sign(x) * np.maximum(np.abs(x) - 2, 0))


def test_a_rate_bias_is_added() -> None:
    np.testing.assert_allclose(filtered("rate_bias", np.array([1.0, -1.0]), (0.25,)), [1.25, -0.75])


def test_only_an_offset_is_a_torque_that_depends_on_nothing() -> None:
    assert [name for name in effects.known() if effects.get(name).is_constant] == ["torque_offset"]


def test_what_makes_readings_late_says_by_how_much() -> None:
    late = {name for name in effects.known() if effects.get(name).late_s((1e-3,)) == 1e-3}
    assert late >= {"torque_delay", "actuator_lag", "sensor_lag"}
    assert effects.get("sensor_lag_second_order").late_s((1e-3,)) == 1e-3
    assert effects.get("coulomb_friction").late_s((1e-3,)) == 0.0
