"""What each named effect contributes."""

from __future__ import annotations

import json

import numpy as np
import pytest

from identify.conclude.contribution import contributions
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.report.files import result_json
from identify.report.summary import summary
from identify.rivals.whole_runs import FreeRunFitter
from identify.runs.holdout import split
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording
from tests.identify.simulated import NOISE_RAD_S, SETS, TRUTH, campaign, decay_run, traces_of

EFFECTS = {"coulomb_friction": {"level": 1.0}, "torque_delay": {"delay": 6e-4}}
VALUES: dict[Name, float] = {
    **{(t,): v for t, v in zip(("inertia", "damping", "stiffness"), TRUTH, strict=True)},
    ("coulomb_friction", "level"): 1.0,
    ("torque_delay", "delay"): 6e-4,
}


def test_it_is_the_held_out_error_without_the_effect_once_the_rest_has_made_up_for_what_it_can() -> None:
    traces = traces_of(campaign(EFFECTS, duration_s=2.0))
    fits, structure = FreeRunFitter(traces, split(traces)), Structure(effects=tuple(EFFECTS))
    found = contributions(fits, structure, VALUES, tuple(EFFECTS), VALUES)
    for name in EFFECTS:
        start = {n: v for n, v in VALUES.items() if n[0] != name}
        best = fits.fitted(structure.minus(name), start, steps=30)
        assert best is not None
        left = float(np.sqrt(best.held_out_chi_square / np.sum(best.held_out_counts))) * fits.noise
        assert found[name] == pytest.approx(left / NOISE_RAD_S, rel=0.1)


def test_a_declared_term_that_an_effect_made_needless_comes_back_without_it() -> None:
    level = {"coulomb_friction": {"level": 0.02}}
    traces = traces_of(Recording((decay_run(Platform(1.0, 0.0, 30.0, level), duration_s=15.0),)))
    fits = FreeRunFitter(traces, split(traces))
    held: dict[Name, float] = {("inertia",): 1.0, ("stiffness",): 30.0, ("coulomb_friction", "level"): 0.02}
    structure = Structure(("inertia", "stiffness"), tuple(level))
    base = {("inertia",): 1.0, ("damping",): 0.05, ("stiffness",): 30.0}
    found = contributions(fits, structure, held, tuple(level), base)
    damped = fits.fitted(Structure(), base)
    assert damped is not None
    left = float(np.sqrt(damped.held_out_chi_square / np.sum(damped.held_out_counts)))
    assert found["coulomb_friction"] == pytest.approx(left, rel=0.1)


def test_a_model_to_which_nothing_was_added_has_none() -> None:
    traces = traces_of(campaign(duration_s=1.0))
    terms = {n: v for n, v in VALUES.items() if len(n) == 1}
    assert contributions(FreeRunFitter(traces, split(traces)), Structure(), terms, (), terms) == {}


def test_every_named_effect_says_what_it_contributes_and_a_declared_one_does_not() -> None:
    settings = IdentifyConfig.model_validate({"candidates": ("coulomb_friction", "torque_delay")})
    declared = Platform(*TRUTH, effects={"torque_delay": {"delay": 5e-4}})
    found = identify(campaign(EFFECTS, sets=SETS[3:4], duration_s=1.0), declared, settings)
    written = json.loads(json.dumps(result_json(found)))["verdict"]
    assert written["effects"] == ["coulomb_friction"]
    assert list(written["contribution"]) == ["coulomb_friction"]
    assert written["contribution"]["coulomb_friction"] > 10.0
    assert "Without it, even after refitting" in summary(found)
