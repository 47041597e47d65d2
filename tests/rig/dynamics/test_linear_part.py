"""Effects that are linear with their states: a Kalman filter corrects those with the motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from rig import effects
from rig.arrays import Array
from rig.dynamics import Equations, Grid, TorqueSignal
from rig.dynamics.gains import Noise, Sensing, StartVariance, _inside, gains_of
from rig.dynamics.linear_part import LinearPart, _resisting, linear_part
from rig.dynamics.predictor import predict_ahead
from rig.effects.base import Place
from rig.platform import Platform
from tests.rig.dynamics.test_predictor import JCK, SIGMA, STEP, TIME

MODE = {"flexible_mode": {"inertia": 0.008, "frequency": 7.0, "ratio": 0.03}}
CREEP = {"creep": {"stiffness": 12.0, "time": 0.3}}
VALUES = {"flexible_mode": (0.008, 7.0, 0.03), "creep": (12.0, 0.3)}
EVERY = [effects.get(name) for name in effects.names()] + list(effects.free_forms().values())
WITH_STATES = [e for e in EVERY if e.place is Place.LOAD and e.states]


@pytest.mark.parametrize("effect", WITH_STATES, ids=lambda e: e.name)
def test_an_effect_says_rightly_whether_it_is_linear_with_its_states(effect: effects.Effect) -> None:
    rng = np.random.default_rng(4)
    own = VALUES.get(effect.name) or tuple(1.5 + 0.1 * k for k in range(len(effect.parameters)))
    p = np.array([*JCK, *own])

    def answer(x: Array) -> Array:
        rates = np.zeros(effect.states)
        torque = _resisting(int(effect.kernel.address), x[0], x[1], x[2:].copy(), rates, p)
        return np.array([torque, *rates])

    one, other = rng.standard_normal((2, 2 + effect.states))
    together = answer(one + 2.0 * other)
    assert (together == pytest.approx(answer(one) + 2.0 * answer(other), rel=1e-9)) is effect.has_linear_states


def test_the_linear_part_of_a_mode_has_the_poles_of_two_inertias() -> None:
    part = linear_part(Equations(Platform(*JCK, MODE)), JCK)
    f = np.zeros((4, 4))
    f[0, 1], f[1, :2] = 1.0, [-part.stiffness / part.inertia, -part.damping / part.inertia]
    f[1, 2:] = -np.array(part.torque) / part.inertia
    f[2:, :2], f[2:, 2:] = part.by_motion, part.by_states
    inertia, frequency, ratio = VALUES["flexible_mode"]
    natural = 2.0 * np.pi * frequency
    spring, damper = inertia * natural**2, 2.0 * inertia * ratio * natural
    mass = np.diag([JCK[0], inertia])
    pull = np.array([[JCK[2] + spring, -spring], [-spring, spring]])
    brake = np.array([[JCK[1] + damper, -damper], [-damper, damper]])
    inverse = np.linalg.inv(mass)
    exact = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ pull, -inverse @ brake]])
    assert np.sort_complex(np.linalg.eigvals(f)) == pytest.approx(np.sort_complex(np.linalg.eigvals(exact)), rel=1e-9)


def _innovations(hidden: dict[str, dict[str, float]], white: float, corrected: bool = True) -> Array:
    """Of a platform that a white torque nobody recorded shakes, with or without its effect's states corrected."""
    rng = np.random.default_rng(1)
    torque = np.sin(2.0 * np.pi * 1.3 * TIME) + 0.5 * np.sin(2.0 * np.pi * 4.1 * TIME)
    equations = Equations(Platform(*JCK, hidden))
    shaken = TorqueSignal(TIME, torque + white * rng.standard_normal(len(TIME)), "zero_order")
    read = Grid(TIME, shaken, 8).simulate(equations, (0.0, 0.0)).angle_rad + SIGMA * rng.standard_normal(len(TIME))
    grid, keep, spans = Grid(TIME, TorqueSignal(TIME, torque, "zero_order"), 8), np.ones(len(TIME), bool), [(0, 2999)]
    part = linear_part(equations, JCK) if corrected else LinearPart(*JCK)
    gains = gains_of(part, Noise(white=white**2 * STEP / SIGMA**2), STEP, Sensing(False, 1.0), keep, spans)
    predicted, _ = predict_ahead(
        equations, grid.shaft_torque(equations), grid.step_s, 8, spans, np.zeros((1, 2)), read[:, None], keep, gains,
        False, 0.0,
    )  # fmt: skip
    return np.asarray((read[:, None] - predicted) / np.sqrt(gains.variance))[:, 0]


def _correlation(left: Array) -> float:
    return max(abs(float(left[k:] @ left[:-k]) / float(left @ left)) for k in range(1, 40))


@pytest.mark.parametrize("hidden", [MODE, CREEP], ids=["flexible_mode", "creep"])
def test_innovations_of_a_linear_effect_are_white_and_as_large_as_foretold(hidden: dict[str, dict[str, float]]) -> None:
    left = _innovations(hidden, 0.2)
    assert np.sqrt(np.mean(left**2)) == pytest.approx(SIGMA, rel=0.05)
    assert _correlation(left) < 4.0 / np.sqrt(len(left))


def test_a_mode_whose_states_nobody_corrects_rings_on_in_the_innovations() -> None:
    assert _correlation(_innovations(MODE, 5.0, corrected=False)) > 10.0 / np.sqrt(len(TIME))


def _behind_a_gap(hidden: dict[str, dict[str, float]], in_motion: tuple[bool, ...]) -> Array:
    """Innovations over what is foretold, behind a gap in which something nobody recorded pushed the platform."""
    rng = np.random.default_rng(2)
    torque = np.sin(2.0 * np.pi * 1.3 * TIME) + 0.5 * np.sin(2.0 * np.pi * 4.1 * TIME)
    gap = slice(1400, 1500)
    pushed = torque.copy()
    pushed[gap] += 3.0
    equations = Equations(Platform(*JCK, hidden))
    motion = Grid(TIME, TorqueSignal(TIME, pushed, "zero_order"), 8).simulate(equations, (0.0, 0.0))
    read = motion.angle_rad + SIGMA * rng.standard_normal(len(TIME))
    keep = np.ones(len(TIME), bool)
    keep[gap] = False
    grid, spans = Grid(TIME, TorqueSignal(TIME, torque, "zero_order"), 8), [(0, gap.stop - 1), (gap.stop, 2999)]
    rate = motion.rate_rad_s
    sizes = [np.mean(np.gradient(rate, STEP) ** 2), np.mean(np.gradient(np.gradient(rate, STEP), STEP) ** 2)]
    begun = StartVariance(1.0, 0.0, *(float(x) / SIGMA**2 for x in (*sizes, np.mean(rate**2))))
    part = linear_part(equations, JCK)
    gains = gains_of(part, Noise(), STEP, Sensing(False, 1.0), keep, spans, begun, in_motion)
    starts = np.array([[0.0, 0.0], [read[gap.stop], rate[gap.stop]]])
    predicted, _ = predict_ahead(
        equations, grid.shaft_torque(equations), grid.step_s, 8, spans, starts, read[:, None], keep, gains, False, 0.0,
    )  # fmt: skip
    return np.asarray((read[:, None] - predicted) / np.sqrt(gains.variance))[gap.stop :, 0] / SIGMA


@pytest.mark.parametrize("hidden", [MODE, CREEP], ids=["flexible_mode", "creep"])
def test_behind_a_gap_nobody_knows_what_moves_inside_the_platform(hidden: dict[str, dict[str, float]]) -> None:
    left, taken_for_known = (_behind_a_gap(hidden, (False, unknown)) for unknown in (True, False))
    assert np.mean(left[:200] ** 2) == pytest.approx(1.0, abs=0.3)
    assert np.mean(left**2) == pytest.approx(1.0, abs=0.1)
    assert np.mean(taken_for_known[:200] ** 2) > 10.0


def test_how_far_a_payload_swings_is_known_from_the_acceleration() -> None:
    """Shaken by noise of the same size and speed, a mode swings against the shaft as far as is foretold."""
    natural, ratio, step_s, count = 2.0 * np.pi * 7.0, 0.03, 1e-4, 400_000
    acceleration = lfilter([1.0], [1.0, -np.exp(-step_s / 2e-3)], np.random.default_rng(3).standard_normal(count))
    jerk = np.gradient(acceleration, step_s)
    b, a = cont2discrete(([1.0], [1.0, 2.0 * ratio * natural, natural**2]), step_s)[:2]
    swing = lfilter(np.ravel(b), a, acceleration)
    begun = StartVariance(0.0, 0.0, float(np.mean(acceleration**2)), float(np.mean(jerk**2)))
    own = {"inertia": 0.008, "frequency": 7.0, "ratio": ratio}
    found = _inside(linear_part(Equations(Platform(*JCK, {"flexible_mode": own})), JCK), begun)
    assert 0.2 < found[0, 0] / np.mean(swing**2) < 5.0
    assert found[1, 1] == pytest.approx(natural**2 * found[0, 0])


def test_a_curve_of_memories_begins_at_rest_in_motion_too() -> None:
    """With starts of its own it would follow anything that settles."""
    begun = StartVariance(0.0, 0.0, 4.0, 9.0, 1.0)
    curve = {"free_memory": {p.name: 1.0 for p in effects.free_forms()["free_memory"].parameters}}
    both = linear_part(Equations(Platform(*JCK, {**CREEP, **curve})), JCK)
    assert len(both.states) > 1
    found = _inside(both, begun)
    assert np.count_nonzero(np.diag(found)) == 1
    assert found[both.begin_at_rest.index(False), both.begin_at_rest.index(False)] > 0.0
