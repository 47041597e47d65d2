"""What a candidate promises before it is fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.estimate.initial_guess import scale_of
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.propose.innovation_score import InnovationScores
from identify.signals.prepare import one_noise, prepare
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, sine_run, white

TIME_S = 2e-3


def test_a_slow_gyro_promises_what_it_explains_though_the_disturbance_hides_it_at_first() -> None:
    """A lag in the sensor changes how much the prediction errs, too: without that its score was zero."""
    runs = []
    for seed, (torque_nm, hertz) in enumerate(((104.0, 3.0), (67.0, 6.0))):
        run = sine_run(
            torque_nm, hertz, seed=seed, noise=2e-3, duration_s=2.0, effects={"sensor_lag": {"time": TIME_S}}
        )
        assert run.torque_nm is not None
        runs.append(replace(run, torque_nm=run.torque_nm + white(len(run.torque_nm), 0.02 * torque_nm, 7 + seed)))
    problem = PredictionError(one_noise([prepare(r, i) for i, r in enumerate(runs)], False))
    start = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}
    now = problem.fit(Structure(), start)
    right = problem.fit(Structure(effects=("sensor_lag",)), {**start, ("sensor_lag", "time"): TIME_S})
    scale = scale_of(problem.traces, TRUTH, ())
    scores = {v[0].effect: v[0].gain for v in InnovationScores(problem, now, scale).all(["sensor_lag", "creep"])}
    assert now.cost - right.cost > 100.0
    assert scores["sensor_lag"] > 100.0, "what chance makes is far below that; it was zero"
    assert np.isfinite(scores["creep"])


def test_what_a_run_has_of_its_own_stays_where_the_runs_looked_at_know_nothing_of_it() -> None:
    """A search looks at some of many runs: a tone's gains of the others were carried to 1e132 by rounding."""
    tone = {"periodic_disturbance": {"sine": 1.5, "cosine": 0.5, "frequency": 4.3}, "torque_delay": {"delay": 1e-3}}
    runs = [
        sine_run(m, f, seed=i, effects=tone, duration_s=1.5) for i, (m, f) in enumerate(((104.0, 3.0), (67.0, 6.0)))
    ]
    first, last = (prepare(run, number) for run, number in zip(runs, (0, 2), strict=True))
    problem = PredictionError(one_noise([first, last], False))
    structure = Structure(effects=("periodic_disturbance",))
    own = {("periodic_disturbance", name, str(run)): 1.0 for name in ("sine", "cosine") for run in (0, 2)}
    start = {**{(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}, **own, ("periodic_disturbance", "frequency"): 4.3}
    fit = problem.fit(structure, start)
    scores = InnovationScores(problem, fit, scale_of(problem.traces, TRUTH, ())).all(["torque_delay", "actuator_lag"])
    assert len(scores) == 2
    unknown = {("periodic_disturbance", name, "1") for name in ("sine", "cosine")}
    for score in scores:
        assert all(score[0].start.get(name, 0.0) == 0.0 for name in unknown)
        assert max(abs(v) for v in score[0].start.values()) < 1e4
    rest = fit.without("damping")
    assert all(rest.get(name, 0.0) == 0.0 for name in unknown)
    assert max(abs(v) for v in rest.values()) < 1e4
