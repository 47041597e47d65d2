"""The final fit: uncertainties that hold, and parameters that the data do not determine."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identify.estimate.covariance import is_white
from identify.estimate.final_fit import FinalFit, by_output_error, by_regression
from identify.estimate.initial_guess import first_guess
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.select.evidence import STRONG_SUPPORT
from identify.signals.trace import Trace, pooled_noise
from rig.recording.run import Recording
from tests.identify.simulated import NOISE_RAD_S, TRUTH, campaign, sine_run, traces_of, white

JCK = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}
TWO_SETS = ((104.0, 3.0), (42.0, 9.0))


def regressed(traces: list[Trace]) -> FinalFit:
    found = split(traces)
    return by_regression(traces, Structure(), {}, first_guess(traces, Structure()), found.final, found.everything, {})


def simulated(traces: list[Trace], effects: tuple[str, ...] = (), **more: float) -> FinalFit:
    found = split(traces)
    start = dict(JCK) | {(e, p): v for e in effects for p, v in more.items()}
    return by_output_error(traces, Structure(effects=effects), start, 0.1, found.final, found.everything)


@pytest.mark.parametrize("fit", [regressed, simulated])
def test_where_the_model_is_right_the_fit_is_limited_by_the_sensor_and_its_intervals_hold_the_truth(
    fit: object,
) -> None:
    found = fit(traces_of(campaign(sets=TWO_SETS)))  # type: ignore[operator]
    assert found.sensor_limited
    assert all(found.determined)
    for name, truth in JCK.items():
        assert abs(found.values[name] - truth) < 4.5 * found.std_error(name)
        assert found.std_error(name) < 1e-3 * truth


def test_regression_and_output_error_agree_to_a_fraction_of_their_own_uncertainty() -> None:
    traces = traces_of(campaign(sets=TWO_SETS))
    a, b = regressed(traces), simulated(traces)
    for name in JCK:
        assert abs(a.values[name] - b.values[name]) < a.std_error(name)
        assert a.std_error(name) == pytest.approx(b.std_error(name), rel=0.2)


def test_a_wrong_model_has_wider_intervals_than_white_noise_would_give() -> None:
    found = regressed(traces_of(campaign({"coulomb_friction": {"level": 1.0}}, sets=TWO_SETS)))
    right = regressed(traces_of(campaign(sets=TWO_SETS)))
    assert not found.sensor_limited
    assert found.std_error(("damping",)) > 20 * right.std_error(("damping",))


def test_a_hidden_friction_in_the_model_is_carried_to_a_free_run_at_the_noise() -> None:
    traces = traces_of(campaign({"coulomb_friction": {"level": 1.0}}, sets=TWO_SETS, duration_s=2))
    found = simulated(traces, ("coulomb_friction",), level=0.8)
    assert found.sensor_limited
    assert found.free_run is not None
    assert found.free_run.sigma == pytest.approx(NOISE_RAD_S, rel=0.05)
    assert found.values["coulomb_friction", "level"] == pytest.approx(1.0, rel=2e-3)


def test_a_parameter_without_information_is_said_to_be_undetermined() -> None:
    traces = traces_of(Recording((sine_run(104, 3),)))
    found = simulated(traces, ("torque_saturation",), limit=500.0)  # never reached
    assert dict(zip(found.names, found.determined, strict=True))["torque_saturation", "limit"] is False


def test_white_noise_is_called_white_and_a_drift_is_not() -> None:
    assert is_white([white(4000), white(4000, seed=1)])
    assert not is_white([np.cumsum(white(4000))])
    slightly = white(4001)
    assert not is_white([slightly[1:] + 0.2 * slightly[:-1]])


def test_the_noise_of_several_runs_is_pooled() -> None:
    traces = traces_of(campaign(sets=TWO_SETS))
    assert pooled_noise(traces) == pytest.approx(NOISE_RAD_S, rel=0.05)


@pytest.mark.parametrize(("level", "supported"), [(0.001, False), (0.003, False), (0.02, True)])
def test_an_effect_is_supported_by_how_far_its_gains_are_from_none(level: float, supported: bool) -> None:
    fitted = SimpleNamespace(structure=Structure(effects=("coulomb_friction", "torque_delay")), count=1000)
    names = (("inertia",), ("coulomb_friction", "level"), ("torque_delay", "delay"))
    values = {("inertia",): 1.0, ("coulomb_friction", "level"): level, ("torque_delay", "delay"): 1e-9}
    fit = FinalFit(cast(Any, fitted), values, names, np.diag([1e-6, 1e-6, 1e-6]), None, False, (True,) * 3, "")
    assert fit.support_of("coulomb_friction") == pytest.approx((level / 1e-3) ** 2 - np.log(1000.0))
    assert (fit.support_of("coulomb_friction") > STRONG_SUPPORT) is supported
    assert fit.support_of("torque_delay") == np.inf  # a delay has no gain that could be none
