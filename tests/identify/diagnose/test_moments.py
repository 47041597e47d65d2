"""Short moments that hold most of a residual."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.diagnose.memory import RunResiduals
from identify.diagnose.moments import moments
from identify.diagnose.wording import diagnosis_sentences
from identify.pipeline import identify
from identify.results import Moment, ResidualDiagnosis
from rig.config.identify import IdentifyConfig
from rig.recording.run import Array
from tests.identify.simulated import DECLARED, campaign

STEP_S = 2e-3


def run(left: Array) -> RunResiduals:
    still = np.zeros(len(left))
    return RunResiduals(
        STEP_S, still, still, still, still, still, np.ones(len(left), bool), np.column_stack([left, left])
    )


def white(seed: int, seconds: float = 10.0) -> Array:
    return np.random.default_rng(seed).standard_normal(round(seconds / STEP_S))


def test_a_touch_of_a_second_is_found_where_it_was() -> None:
    touched = white(1)
    touched[2500:3000] += 20.0 * np.sin(np.linspace(0.0, np.pi, 500))
    touched[1000:1125] *= 6.0  # loud, and next to nothing beside the touch
    found = moments([run(white(0)), run(touched)], [0.0, 3.0], ["a", "b"])[0]
    assert [m.run for m in found] == ["b"]
    assert found[0].from_s == pytest.approx(3.0 + 5.0, abs=0.26)
    assert found[0].to_s == pytest.approx(3.0 + 6.0, abs=0.26)
    assert found[0].share > 0.8


@pytest.mark.parametrize("sort", ["noise", "steady tone", "beats", "every period", "too short"])
def test_what_is_spread_over_a_run_is_no_moment(sort: str) -> None:
    time = STEP_S * np.arange(5000)
    left = {
        "noise": white(3),
        "steady tone": white(3) + 10.0 * np.sin(2 * np.pi * 3.0 * time),
        "beats": white(3) + 10.0 * np.sin(2 * np.pi * 3.0 * time) * np.sin(2 * np.pi * 0.15 * time),
        "every period": white(3) + 40.0 * (np.sin(2 * np.pi * 0.6 * time) > 0.99),
        "too short": np.concatenate([20.0 * white(4, 0.3), white(5, 1.0)]),
    }[sort]
    assert moments([run(left)], [0.0], ["a"]) == ((), ())


def moving(left: Array, rate: Array) -> RunResiduals:
    """A run whose model follows a rate, with its angle and a torque in proportion."""
    angle = STEP_S * np.cumsum(rate)
    return RunResiduals(STEP_S, angle, rate, rate, angle, rate, np.ones(len(left), bool), np.column_stack([left, left]))


@pytest.mark.parametrize("power", [1, 2, 3])
def test_the_resonance_that_a_chirp_crosses_is_no_moment_and_a_touch_beside_it_is(power: int) -> None:
    time = STEP_S * np.arange(7500)
    crossing = 0.1 + np.exp(-(((time - 6.2) / 0.9) ** 2))
    rate = crossing * np.sin(2 * np.pi * (0.5 * time + 0.25 * time**2))
    left = 0.01 * white(7, 15.0) + 5.0 * np.sign(rate) * np.abs(rate) ** power
    assert moments([moving(left, rate)], [0.0], ["a"])[0] == ()
    left[5500:5750] += 60.0
    (found,) = moments([moving(left, rate)], [0.0], ["a"])[0]
    assert (found.from_s, found.to_s) == (pytest.approx(11.0, abs=0.26), pytest.approx(11.5, abs=0.26))


@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_a_frequency_at_which_the_model_is_wrong_is_no_moment_of_a_chirp(turn: float) -> None:
    """A narrow mode at 9 Hz that the model lacks; ``turn`` is by how much the phase turns across it."""
    time = STEP_S * np.arange(7500)
    hz = 0.8 * time
    phase = 2 * np.pi * 0.4 * time**2
    across = np.clip((hz - 9.0) / 0.4, -1.0, 1.0)
    left = 0.01 * white(9, 15.0) + np.exp(-(((hz - 9.0) / 0.4) ** 2)) * np.sin(phase + 0.5 * turn * across)
    one, other = moving(left, np.sin(phase)), moving(0.01 * white(10, 15.0), np.sin(2 * np.pi * time))
    assert moments([one, other], [0.0, 0.0], ["a", "b"])[0] == ()
    touched = one.left.copy()
    touched[4000:4250] += 3.0
    (found,) = moments([replace(one, left=touched), other], [0.0, 0.0], ["a", "b"])[0]
    assert found.from_s == pytest.approx(8.0, abs=0.26)


def test_a_moment_ends_with_its_run() -> None:
    left = white(8)
    left[-250:] += 40.0
    (found,) = moments([run(left[:4990])], [2.0], ["a"])[0]
    assert found.to_s == pytest.approx(2.0 + 4989 * STEP_S)


def test_samples_that_do_not_count_are_no_moment() -> None:
    left = white(6)
    left[1000:1100] = 1e6
    one = run(left)
    use = one.use.copy()
    use[1000:1100] = False
    assert moments([replace(one, use=use)], [0.0], ["a"])[0] == ()


def test_a_moment_is_told_with_its_run_its_time_and_what_to_do() -> None:
    found = ResidualDiagnosis("torque", "N*m", 7.0, None, (), None, None, (Moment("r1.csv", 5.0, 6.0, 0.93),))
    (level, said) = diagnosis_sentences(found, "rotary")
    assert "7" in level
    assert "shows no" not in level
    assert said.startswith("93 % of it lies in r1.csv from 5.00 to 6.00 s (93 %)")
    assert "from_s or to_s" in said


@pytest.mark.slow
def test_a_push_of_half_a_second_is_told_by_the_whole_identification() -> None:
    recording = campaign(duration_s=5)
    runs = list(recording.runs)
    torque, rate = runs[1].torque_nm, runs[1].rate_rad_s
    assert torque is not None
    assert rate is not None
    push = np.where((runs[1].time_s > 2.0) & (runs[1].time_s < 2.5), 20.0, 0.0)
    runs[1] = replace(runs[1], torque_nm=torque - push)  # the platform felt what the record does not hold
    found = identify(
        replace(recording, runs=tuple(runs)), DECLARED, IdentifyConfig(candidates=["coulomb_friction", "torque_offset"])
    )
    assert found.verdict.effects == ()
    left = found.residual_before
    assert left is not None
    assert {m.run for m in left.moments} == {runs[1].name}
    assert left.moments[0].from_s == pytest.approx(2.0, abs=0.3)
    assert left.moments[0].to_s == pytest.approx(2.5, abs=0.3)
