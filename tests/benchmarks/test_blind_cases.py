"""The cases of the blind bench: they hide their truth, and are scored honestly."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from benchmarks.blind import cases, imitation, library, run
from benchmarks.blind.bound import DETECTABLE
from benchmarks.blind.excitations import Excitation, multisine, sine
from benchmarks.blind.hidden import Hidden
from benchmarks.blind.recordings import write_case
from benchmarks.blind.score import score

JCK = (0.02, 0.045, 677.3)
ORDER_OF_ONE = cases.Order("single", ("backlash",), 0.01, 1, "short")


@cache
def sets() -> tuple[Excitation, ...]:
    """Made when they are asked for: what draws them is compiled."""
    return sine(111.0, 1.0, 2.0), sine(42.0, 9.0, 2.0), multisine(60.0, (2.0, 7.0, 13.0, 19.0), 2.0, 0.5, 4)


@pytest.fixture(scope="module")
def case() -> cases.Case:
    return cases.make(11, 4, ORDER_OF_ONE)


def test_a_case_keeps_its_size_and_the_limits_and_hides_its_truth(case: cases.Case, tmp_path: Path) -> None:
    assert case.sizes["backlash"] == pytest.approx(0.01, rel=0.04)
    assert case.energy["backlash"].energy > DETECTABLE
    for record in case.records:
        assert np.abs(record.angle_rad).max() < math.radians(10.0)
        assert np.abs(record.rate_rad_s).max() < math.radians(400.0)
    write_case(case, tmp_path / "case", tmp_path / "elsewhere" / "truth.json")
    shown = (tmp_path / "case" / "rig.yaml").read_text(encoding="utf-8")
    assert "backlash" not in shown
    assert set(yaml.safe_load(shown)["model"]) == {"inertia_kg_m2", "damping_nm_s_rad", "stiffness_nm_rad"}
    assert not list((tmp_path / "case").glob("*.json"))


def test_the_same_seed_gives_the_same_case_and_another_seed_another() -> None:
    short = cases.Order("single", ("backlash",), 0.01, 1, "short")
    one, again, other = (cases.make(seed, 4, short) for seed in (11, 11, 12))
    assert np.array_equal(again.measured[0], one.measured[0])
    assert other.hidden.inertia != one.hidden.inertia


def test_every_effect_comes_at_every_size_before_any_comes_twice() -> None:
    plan = cases.orders(3, 200, kinds=["single"])
    first = [(o.effects, o.size) for o in plan[: 3 * len(library.LIBRARY)]]
    assert len(set(first)) == len(first)


def result(case: cases.Case, named: dict[str, dict[str, float]], rivals: tuple[str, ...] = ()) -> dict[str, Any]:
    """A result.json that finds J, C, K and says ``named``."""
    terms = dict(zip(("inertia", "damping", "stiffness"), case.reference(), strict=True))
    model = {
        "parameters": {n: {"value": v, "ci95": [0.99 * v, 1.01 * v]} for n, v in terms.items()},
        "effect_parameters": {n: {k: {"value": x} for k, x in v.items()} for n, v in named.items()},
        "error": {"holdout_rate_rms": case.hidden.noise},
    }
    verdict = {
        "effects": list(named), "confusable_with": {n: list(rivals) for n in named}, "unexplained": False,
        "never_separable": {},
    }  # fmt: skip
    return {"accepted": True, "before": model, "after": model, "verdict": verdict}


def scored(case: cases.Case, found: dict[str, Any] | None, code: int = 0) -> Any:
    truth = json.loads(json.dumps(case.truth()))
    return score(truth, found, 1.0, 1.0, code)


def test_the_truth_scores_as_right(case: cases.Case) -> None:
    s = scored(case, result(case, {k: dict(v) for k, v in case.hidden.effects.items()}))
    assert s.wrong == ""
    assert s.exact and s.first
    assert s.replayed == pytest.approx(1.0, abs=1e-6)
    assert s.covered == (True, True, True)


@pytest.mark.slow
def test_a_wrong_name_an_extra_name_silence_and_a_crash_score_as_wrong(case: cases.Case) -> None:
    truth = {k: dict(v) for k, v in case.hidden.effects.items()}
    cubic = {"cubic_stiffness": {"factor": 3.0}}
    assert scored(case, result(case, cubic)).wrong == "single: wrong name"
    assert scored(case, result(case, cubic, ("backlash",))).wrong == "single: wrong name"  # physics parts these two
    assert scored(case, result(case, truth | cubic)).wrong == "single: more besides"
    assert scored(case, result(case, {})).wrong == "single: nothing named"
    assert scored(case, None, 70).wrong == "exit code 70"


def test_a_pair_that_physics_cannot_part_counts_where_both_are_named() -> None:
    lag = cases.make(11, 1, cases.Order("single", ("sensor_lag",), 0.01, 1, "short"))
    other = {"actuator_lag": dict(lag.hidden.effects["sensor_lag"])}
    alone, both = scored(lag, result(lag, other)), scored(lag, result(lag, other, ("sensor_lag",)))
    assert alone.wrong and not alone.first
    assert both.wrong == "" and both.declared


@pytest.mark.slow
def test_a_rival_that_passes_for_the_truth_in_this_record_has_to_be_declared() -> None:
    late = Hidden(*JCK, {"torque_delay": {"delay": 5e-5}}, noise=math.radians(0.2))
    (energy,) = imitation.confusable(late, sets(), "torque_delay").values()
    assert energy < DETECTABLE, "a lag that short is a delay"
    gap = Hidden(*JCK, {"backlash": {"half_gap": 0.003}})
    assert imitation.imitation(gap, sets(), "backlash", "cubic_stiffness") > DETECTABLE
    case = cases.make(11, 6, cases.Order("single", ("torque_delay",), 0.003, 2, "five_sines"))
    truth = {k: dict(v) for k, v in case.hidden.effects.items()}
    alike = {"torque_delay": ["actuator_lag"]}
    assert score(case.truth(), result(case, truth), 1.0, 1.0, 0).declared is None
    assert score(case.truth(), result(case, truth), 1.0, 1.0, 0, alike).declared is False
    assert score(case.truth(), result(case, truth, ("actuator_lag",)), 1.0, 1.0, 0, alike).declared is True


def test_a_follow_up_is_played_and_judged_with_all_the_data(
    case: cases.Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def tool(folder: Path, results: Path) -> tuple[float, float, int]:
        results.mkdir(parents=True)
        files = [
            run["file"] for run in yaml.safe_load((folder / "rig.yaml").read_text(encoding="utf-8"))["recorded"]["runs"]
        ]
        seen.append(files)
        assert all((folder / file).is_file() for file in files)
        (results / "follow_up.yaml").write_text(
            "sets: [{torque_nm: 30, frequency_hz: 4, duration_s: 1}]\n", encoding="utf-8"
        )
        return 1.0, 1.0, 0

    monkeypatch.setattr(run, "identify", tool)
    monkeypatch.setattr(run, "make", lambda seed, number, order: case)
    first = run.one(11, 4, ORDER_OF_ONE, tmp_path, again=False, rivals=False)
    after = run.follow(4, tmp_path, "follow_up.yaml", again=False)
    assert first and after and first.wrong and after.wrong  # this tool finds nothing
    assert seen[1] == [*seen[0], "run101.npz"]


def test_anything_named_on_a_clean_platform_is_a_false_alarm() -> None:
    clean = cases.make(11, 2, cases.Order("torque_scale", (), 0.01, 1, "short"))
    assert clean.reference()[0] == pytest.approx(clean.hidden.inertia * clean.hidden.torque_scale)
    assert scored(clean, result(clean, {})).wrong == ""
    assert scored(clean, result(clean, {"torque_delay": {"delay": 1e-5}})).wrong == "false alarm"


@pytest.mark.slow
def test_an_effect_outside_the_library_has_to_stay_unexplained() -> None:
    bump = cases.make(11, 3, cases.Order("outside", ("bump_stop",), 0.01, 1, "five_sines"))
    silent = result(bump, {})
    assert scored(bump, silent).wrong == "outside: not unexplained"
    silent["verdict"]["unexplained"] = True
    assert scored(bump, silent).wrong == ""
    assert scored(bump, result(bump, {"backlash": {"half_gap": 1e-4}})).wrong == "outside: named"


def test_an_effect_far_below_the_noise_counts_as_undetectable() -> None:
    hidden = Hidden(*JCK, {"cubic_stiffness": {"factor": 1e-3}})
    assert not cases.energies(hidden, sets(), hidden.play(sets()))["cubic_stiffness"].detectable


def test_a_mass_off_the_axis_counts_by_what_no_other_stiffness_imitates() -> None:
    hidden = Hidden(*JCK, {"unbalance": {"sine": 0.05 * JCK[2], "cosine": 0.0}})
    small = [sine(1.0, 1.0, 3.0), sine(1.0, 5.0, 3.0)]  # so little travel that a sine of the angle is the angle
    assert cases.energies(hidden, small, hidden.play(small))["unbalance"].energy < 1.0
