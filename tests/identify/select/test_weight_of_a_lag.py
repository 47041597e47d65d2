"""A lag of the gyro has no torque of its own, but makes the motion late: what is left as a torque must show it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.select.evidence import EvidenceModel
from identify.signals.prepare import one_noise, prepare
from rig import effects as effects_of
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, Effects, sine_run

SETS = ((67.0, 6.0), (104.0, 3.0), (42.0, 9.0))
LAG_S = 2e-3


LAGGING: Effects = {"sensor_lag": {"time": LAG_S}}


@cache
def of_a_lag() -> tuple[PredictionError, TorqueRegression, Fit]:
    """Two tests ask about it."""
    return fits_of(LAGGING)


def fits_of(effects: Effects) -> tuple[PredictionError, TorqueRegression, Fit]:
    """Of three sets, and the model with J, C and K alone."""
    runs = [sine_run(m, f, seed=i, effects=effects, duration_s=1.5) for i, (m, f) in enumerate(SETS)]
    traces = one_noise([prepare(run, i) for i, run in enumerate(runs)], False)
    problem = PredictionError(traces)
    platform: dict[Name, float] = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}
    base = problem.fit(Structure(), platform)
    regression = TorqueRegression(traces, split(traces), 50.0, scale_of(traces, TRUTH, ()))
    return problem, regression, base


def weigher_of(effects: Effects) -> tuple[EvidenceModel, Fit]:
    problem, regression, base = of_a_lag() if effects is LAGGING else fits_of(effects)
    return EvidenceModel(problem, regression, regression.noise_floor_nm(base.values)), base


def with_a_lag(weigher: EvidenceModel, base: Fit, name: str = "sensor_lag", late_s: float = LAG_S) -> Fit:
    parameter = effects_of.get(name).parameters[0].name
    return weigher.problem.fit(Structure().plus(name), {**base.values, (name, parameter): late_s}, base.noise)


def weight_of_a_lag(effects: Effects) -> tuple[float, float]:
    """Of a gyro's low-pass beside J, C and K: what it takes of the disturbance, and how much the cost falls."""
    weigher, base = weigher_of(effects)
    found = weigher.evidence("sensor_lag", base, with_a_lag(weigher, base))
    return found.weight, found.gain


def test_a_lag_that_is_there_takes_what_is_left_in_torque() -> None:
    weight, gain = weight_of_a_lag(LAGGING)
    assert weight > 0.9
    assert gain > 1000.0


@pytest.mark.parametrize(
    "effects",
    [
        {"flexible_mode": {"inertia": 0.004, "frequency": 14.0, "ratio": 0.02}},
        {"cubic_stiffness": {"factor": 4000.0}},
    ],
)
def test_a_lag_that_smooths_the_torque_of_something_else_takes_none_of_it(effects: Effects) -> None:
    weight, _ = weight_of_a_lag(effects)
    assert np.isfinite(weight)
    assert weight < 0.2


def test_a_lag_weighs_as_much_as_a_delay_of_the_drive_that_is_as_long_and_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    weigher, base = weigher_of(LAGGING)
    shares = {False: 0.9, True: 0.1}  # of a torque, and of what has none
    monkeypatch.setattr(weigher, "explained_share", lambda now, new, trusted, torqueless=False: shares[torqueless])
    lag, delay = with_a_lag(weigher, base), with_a_lag(weigher, base, "torque_delay")
    late_s = lag.values[("sensor_lag", "time")]
    assert delay.names[-1] == ("torque_delay", "delay")
    longer, as_long = (replace(delay, vector=np.append(delay.vector[:-1], t)) for t in (2.0 * late_s, 1.05 * late_s))
    assert weigher.evidence("sensor_lag", base, lag).weight == 0.1
    assert weigher.all(base, {"sensor_lag": lag, "torque_delay": longer})["sensor_lag"].weight == 0.1
    assert weigher.all(base, {"sensor_lag": lag, "torque_delay": as_long})["sensor_lag"].weight == 0.9
    assert weigher.evidence("sensor_lag", base, lag).weight == 0.9  # asked again, it is remembered
