"""The final fit over whole runs: it keeps what they support, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identify.conclude import final_models
from identify.conclude.final_models import FinalModels
from identify.estimate.final_fit import FinalFit
from identify.estimate.initial_guess import first_guess
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.results import Candidate
from identify.runs.holdout import split
from identify.select.search_state import Search
from identify.signals.prepare import one_noise, prepare
from rig.dynamics import TorqueSignal, simulate
from rig.platform import TERMS, Platform
from rig.recording.run import Run
from tests.identify.simulated import NOISE_RAD_S, TRUTH, campaign, sine_run, traces_of, white

FOUND = ("coulomb_friction", "quadratic_damping")
DECLARED = Platform(*TRUTH)


def final(drag: float) -> tuple[list[str], Search, list[str]]:
    """What the final fit keeps of a model that the search has found, of runs with Coulomb friction and some drag."""
    there = {"coulomb_friction": {"level": 4.0}, "quadratic_damping": {"factor": drag}}
    traces = traces_of(campaign(there))
    values = dict(zip((("inertia",), ("damping",), ("stiffness",)), TRUTH, strict=True))
    values |= {("coulomb_friction", "level"): 4.0, ("quadratic_damping", "factor"): max(drag, 1e-3)}  # type: ignore[dict-item]
    base: Any = SimpleNamespace(structure=Structure(), values=values)
    best: Any = SimpleNamespace(structure=Structure(effects=FOUND), values=values)
    search = Search(base, best, 1.0, 0.0, [Candidate(name, 1, -100.0, None, "added") for name in FOUND])
    said: list[str] = []
    start = first_guess(traces, Structure())
    models = FinalModels(traces, split(traces, "auto"), DECLARED, Structure(), start, said.append)
    return list(models.after(cast(Any, search)).structure.effects), search, said


def test_an_effect_that_does_not_differ_from_none_over_whole_runs_is_dropped() -> None:
    kept, search, said = final(0.0)
    assert kept == ["coulomb_friction"]
    assert list(search.best.structure.effects) == kept
    assert {c.effect: c.status for c in search.candidates}["quadratic_damping"] == "added, then no longer needed"
    assert any("whole runs are explained as well without it" in line for line in said)


def test_an_effect_that_does_stays() -> None:
    kept, _, said = final(0.5)
    assert kept == list(FOUND) and not any("explained as well" in line for line in said)


def pushed(size_nm: float) -> list[Run]:
    """Two sets of a platform that rings, under a white torque of ``size_nm`` a sample that nobody recorded."""
    runs = []
    for seed, (torque_nm, hertz) in enumerate(((111.0, 1.0), (67.0, 6.0))):
        run = sine_run(torque_nm, hertz, duration_s=2.5)
        unrecorded = TorqueSignal(run.time_s, white(len(run.time_s), size_nm, 40 + seed))
        assert run.rate_rad_s is not None
        swing = simulate(DECLARED, run.time_s, unrecorded, substeps=16).rate_rad_s
        runs.append(replace(run, rate_rad_s=run.rate_rad_s + swing))
    return runs


def declared_model_of(runs: list[Run]) -> FinalFit:
    """The final fit of the right model, declared as it is."""
    traces = one_noise([prepare(run, i) for i, run in enumerate(runs)], False)
    parts = split(traces, "auto")
    best = PredictionError(traces, parts.final).fit(Structure(), {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)})
    models = FinalModels(traces, parts, DECLARED, Structure(), first_guess(traces, Structure()), lambda _: None)
    return models.before(Search(best, best, 1.0, NOISE_RAD_S))


def sigmas_off(found: FinalFit) -> list[float]:
    return [(found.values[(k,)] - v) / found.std_error((k,)) for k, v in zip(TERMS, TRUTH, strict=True)]


def test_a_torque_that_a_free_run_does_not_show_is_in_the_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    """A resonance makes it a swing of the sensor's own size, and alike from period to period: no mean is rid of it."""
    found = declared_model_of(pushed(8e-4))
    assert found.sensor_limited and found.method == "prediction error"
    assert np.max(np.abs(sigmas_off(found))) < 3.0
    monkeypatch.setattr(final_models, "disturbance_support", lambda *_: 0.0)
    assert np.max(np.abs(sigmas_off(declared_model_of(pushed(8e-4))))) > 4.0


def test_runs_that_nothing_disturbs_are_told_by_their_free_run() -> None:
    found = declared_model_of(pushed(0.0))
    assert found.method == "output error over whole runs"
    assert np.max(np.abs(sigmas_off(found))) < 3.0
