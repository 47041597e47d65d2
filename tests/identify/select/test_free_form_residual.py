"""What no effect on offer describes is shown as a curve, and no effect is named in its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.results import Identification
from identify.select.free_form_residual import _without_scale, dependence_on
from rig import effects
from rig.config.identify import IdentifyConfig
from rig.platform import TERMS, Platform
from rig.recording.run import Recording
from tests.identify.simulated import TRUTH, Effects, sine_run, traces_of, white

SETS = ((67.0, 6.0), (111.0, 1.0), (104.0, 3.0))
OFFERED = ("torque_delay", "actuator_lag", "creep", "coulomb_friction")
CUBIC = {"cubic_stiffness": {"factor": 4000.0}}


def found(
    hidden: Effects, sets: Sequence[tuple[float, float]] = SETS, lasts_s: float = 2.5, offered: Sequence[str] = OFFERED
) -> Identification:
    """Sets with an effect and with a small torque that was not recorded."""
    runs = []
    for seed, (torque_nm, hertz) in enumerate(sets):
        run = sine_run(torque_nm, hertz, seed=seed, effects=hidden, duration_s=lasts_s)
        assert run.torque_nm is not None
        runs.append(replace(run, torque_nm=run.torque_nm + white(len(run.torque_nm), 0.003 * torque_nm, 50 + seed)))
    return identify(Recording(tuple(runs)), Platform(*TRUTH), IdentifyConfig(candidates=tuple(offered)))


@cache
def found_beside_a_cube() -> Identification:
    return found(CUBIC, SETS[::2], 1.5, OFFERED[:2])


@pytest.mark.parametrize(
    ("hidden", "on"),
    [
        (CUBIC, "angle"),
        pytest.param({"quadratic_damping": {"factor": 0.05}}, "rate", marks=pytest.mark.slow),
    ],
)
def test_what_no_effect_on_offer_describes_is_unexplained_and_not_called_a_delay(hidden: Effects, on: str) -> None:
    identification = found_beside_a_cube() if hidden is CUBIC else found(hidden)
    assert identification.verdict.effects == ()
    assert identification.verdict.unexplained
    assert identification.disturbance is not None
    assert on in [d.on for d in identification.disturbance.depends_on]


@pytest.mark.slow
def test_of_a_right_model_no_curve_is_left() -> None:
    identification = found({})
    assert identification.verdict.effects == ()
    assert identification.disturbance is not None
    assert identification.disturbance.depends_on == ()
    assert identification.accepted, identification.reasons
    assert np.isclose(identification.final.parameters["inertia"].value, TRUTH[0], rtol=5e-3)


def test_the_shape_of_what_is_left_is_that_of_the_torque_that_nobody_offered() -> None:
    """Its constant and its straight part are the model's: what is left of a cubic spring is a cubic without them."""
    left = found_beside_a_cube().disturbance
    assert left is not None
    curve = next(d for d in left.depends_on if d.on == "angle")
    at, shape = np.array(curve.at), np.array(curve.shape_nm)
    missing = 4000.0 * at**3
    straight = np.polynomial.Polynomial.fit(at, missing - shape, 1)
    assert np.std(shape + straight(at) - missing) < 0.1 * np.std(missing)


def test_what_a_spring_of_the_model_would_take_with_another_size_is_not_left_over() -> None:
    """A cube and a curve over the angle beside it: whatever the one gives up the other takes."""
    sets = [sine_run(*one, seed=k, effects=CUBIC, duration_s=2.5) for k, one in enumerate(SETS[:2])]
    problem = PredictionError(traces_of(Recording(tuple(sets))))
    start: dict[Name, float] = {(t,): v for t, v in zip(TERMS, TRUTH, strict=True)}
    now = problem.fit(Structure(effects=("cubic_stiffness",)), {**start, ("cubic_stiffness", "factor"): 4000.0})
    most = max(float(np.max(np.abs(t.fine[0]))) for t in problem.traces)
    names = [p.name for p in effects.get("free_angle").parameters]
    places = np.linspace(-most, most, len(names) - 1)
    taken = 4000.0 * (places**3 - most**2 * places)  # a curve is zero at its ends
    shape = dict(zip(names, [-most, most, 0.0, *taken[1:-1]], strict=True))
    values = {**now.values, ("cubic_stiffness", "factor"): 0.0, **{("free_angle", n): v for n, v in shape.items()}}
    beside = problem.fit(now.structure.plus("free_angle"), values, now.noise, 0)
    left = SimpleNamespace(now=now, evidence=SimpleNamespace(fit=beside), form="free_angle", chance_level=1e-9)
    curve, _ = dependence_on(cast(Any, SimpleNamespace(problem=problem)), cast(Any, left))
    assert curve.torque_rms < 0.2 * float(np.std(taken))


def moved_by_a_curve_that_jumps(friction: tuple[str, ...]) -> float:
    """By how much a curve over the rate moves the damping, as a share of its slope at rest."""
    problem = PredictionError(traces_of(Recording((sine_run(*SETS[1], duration_s=2.5),))))
    start: dict[Name, float] = {(t,): v for t, v in zip(TERMS, TRUTH, strict=True)}
    now = problem.fit(Structure(effects=friction), start)
    most = max(float(np.max(np.abs(t.fine[1]))) for t in problem.traces)
    names = [p.name for p in effects.get("free_rate").parameters]
    places = np.linspace(-most, most, len(names) - 1)
    taken = 0.5 * np.sign(places) * (1.0 - np.abs(places) / most)
    shape = dict(zip(names, [-most, most, 0.0, *taken[1:-1]], strict=True))
    values = {**now.values, **{("free_rate", n): v for n, v in shape.items()}}
    beside = replace(
        now, structure=now.structure.plus("free_rate"), names=tuple(values), vector=np.array(list(values.values())),
        information=1e12 * np.eye(len(values)),
    )  # fmt: skip
    left = SimpleNamespace(now=now, evidence=SimpleNamespace(fit=beside), form="free_rate", chance_level=1e-9)
    curve, moves = dependence_on(cast(Any, SimpleNamespace(problem=problem)), cast(Any, left))
    at_rest = float(np.interp(0.0, curve.at, np.gradient(np.array(curve.shape_nm), np.array(curve.at))))
    return moves["damping"] / 100.0 * now.values["damping",] / at_rest


def test_beside_dry_friction_the_damping_is_that_of_sliding() -> None:
    """There a curve over the rate may be as steep at rest as it likes: friction jumps there."""
    assert moved_by_a_curve_that_jumps(()) == pytest.approx(1.0)
    assert moved_by_a_curve_that_jumps(("coulomb_friction",)) < 0.6


def test_a_gain_that_is_the_same_throughout_is_another_scale_and_no_torque_that_is_left() -> None:
    torque = np.sin(np.linspace(0.0, 60.0, 3000))
    beside, scale, swing = _without_scale(0.65 * torque, torque)
    assert scale == pytest.approx(0.65)
    assert np.max(np.abs(beside)) < 1e-12 and swing < 1e-12


def test_of_a_gain_that_falls_the_change_counts() -> None:
    torque = np.sin(np.linspace(0.0, 60.0, 3000))
    beside, scale, swing = _without_scale(np.linspace(0.0, 0.1, 3000) * torque, torque)
    assert scale == pytest.approx(0.05, rel=0.02)
    assert swing == pytest.approx(0.05 / 0.95, rel=0.05)
    assert np.sqrt(np.mean(beside**2) / np.mean(torque**2)) == pytest.approx(0.1 / 12**0.5 / 0.95, rel=0.05)
