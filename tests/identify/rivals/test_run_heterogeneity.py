"""One run whose torque was another one than was recorded, against an effect of the platform."""

from __future__ import annotations

from dataclasses import replace

import pytest

from identify.conclude.next_steps import next_steps
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.rivals.run_heterogeneity import describe, explains_as_much, heterogeneity_of
from identify.rivals.whole_runs import FreeRunFitter
from identify.runs.holdout import split
from rig.config.identify import IdentifyConfig
from rig.recording.run import Recording, Run
from tests.identify.simulated import DECLARED, SETS, TRUTH, Effects, sine_run, traces_of

START: dict[Name, float] = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}


def runs(effects: Effects | None = None) -> list[Run]:
    """The five sets."""
    return [sine_run(m, f, effects=effects, seed=i) for i, (m, f) in enumerate(SETS)]


def recorded(run: Run, gain: float = 1.0, late_s: float = 0.0) -> Run:
    """With a platform that got ``gain`` times the recorded torque, that much earlier than recorded."""
    assert run.torque_nm is not None
    assert run.torque_time_s is not None
    return replace(run, torque_nm=run.torque_nm / gain, torque_time_s=run.torque_time_s + late_s)


def fits_of(campaign: list[Run]) -> FreeRunFitter:
    """To the samples that fit."""
    traces = traces_of(Recording(tuple(campaign)))
    return FreeRunFitter(traces, split(traces))


def test_runs_that_agree_need_no_other_torque() -> None:
    assert heterogeneity_of(fits_of(runs()), Structure(), START) is None


def test_the_run_and_the_size_are_told() -> None:
    five = runs()
    five[3] = recorded(five[3], gain=0.997)
    found = heterogeneity_of(fits_of(five), Structure(), START)
    assert found is not None
    ((run, kind, size),) = found.changes
    assert (run, kind) == ("6 Hz", "gain")
    assert size == pytest.approx(-0.003, abs=1e-4)
    assert "smaller by 0.30 % in 6 Hz" in describe(found, linear=False)[0]


def test_a_run_whose_torque_is_stamped_late_is_told_by_its_milliseconds() -> None:
    five = runs()
    five[2] = recorded(five[2], late_s=2e-3)
    found = heterogeneity_of(fits_of(five), Structure(), START)
    assert found is not None
    ((run, kind, size),) = found.changes
    assert (run, kind) == ("3 Hz", "delay")
    assert size == pytest.approx(-2e-3, abs=2e-6)
    assert "2.0 ms earlier in 3 Hz" in describe(found, linear=False)[0]


@pytest.mark.parametrize(
    "hidden",
    [
        {"cubic_stiffness": {"factor": 300.0}},
        {"coulomb_friction": {"level": 0.5}},
        {"torque_delay": {"delay": 1e-3}},
        {"flexible_mode": {"inertia": 0.004, "frequency": 60.0, "ratio": 0.02}},
    ],
)
def test_no_other_torque_in_a_few_runs_explains_an_effect_of_the_platform_as_well(hidden: Effects) -> None:
    fits = fits_of(runs(hidden))
    found = heterogeneity_of(fits, Structure(), START)
    if found is not None:
        (name,) = hidden
        own: dict[Name, float] = {(name, p): v for p, v in hidden[name].items()}
        named = fits.fitted(Structure(effects=(name,)), {**START, **own})
        assert named is not None
        assert not explains_as_much(found, named)


@pytest.mark.slow
def test_two_runs_of_which_one_had_more_torque_are_no_second_resonance() -> None:
    """A mode far above all excitation had been accepted, with J half of what it is."""
    two = [sine_run(104.0, 3.0, seed=1, duration_s=6.0), sine_run(42.0, 9.0, seed=2, duration_s=6.0)]
    settings = IdentifyConfig.model_validate({"candidates": ["flexible_mode"]})
    found = identify(Recording((two[0], recorded(two[1], gain=1.01))), DECLARED, settings)
    assert found.verdict.effects == ()
    assert found.verdict.unexplained
    assert not found.accepted
    assert "The runs disagree with each other" in found.verdict.left_open
    assert "multisine" in " ".join(next_steps(found))
