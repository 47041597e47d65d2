"""result.json, model.yaml and the folder they stand in."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from identify.conclude.plausibility import with_declared
from identify.report.files import final_platform, model_text, result_json, write_results
from identify.results import Errors, Identification, NotReported
from rig.config.model import ModelConfig
from rig.platform import Platform
from rig.recording.run import Recording
from tests.identify.sample import TRUTH, estimate, sample, unhappy

DECLARED = Platform(0.0185, 0.06, 650.0)


@pytest.fixture(scope="module")
def found() -> Identification:
    return sample(2.0)[0]


@pytest.fixture(scope="module")
def recording() -> Recording:
    return sample(2.0)[1]


@pytest.fixture(scope="module")
def written(found: Identification) -> dict[str, Any]:
    return dict(json.loads(json.dumps(result_json(found), allow_nan=False)))


def with_final(found: Identification, **changes: Any) -> Identification:
    """The identification with another final model."""
    return replace(found, after=replace(found.final, **changes))


def test_declared_numbers_and_what_is_implausible_beside_them_are_written(found: Identification) -> None:
    odd = result_json(with_declared(found, {"inertia": 0.0203 * 57.3, "stiffness": 681.2 * 57.3}))
    assert odd["declared"] == {"inertia": 0.0203 * 57.3, "stiffness": 681.2 * 57.3}
    (one,) = odd["plausibility"]
    assert one["parameters"] == ["inertia", "stiffness"]
    assert one["fitted_over_declared"] == pytest.approx(1 / 57.3, rel=1e-3)
    assert result_json(found)["plausibility"] == []


def test_it_has_the_keys_that_outside_scripts_rely_on(written: dict[str, Any]) -> None:
    assert written["schema_version"] == 1
    assert written["accepted"] is True
    assert set(written) >= {"before", "verdict", "after", "noise_floor", "per_set"}
    assert set(written["verdict"]) >= {
        "effects",
        "confusable_with",
        "unexplained_fraction",
        "unexplained",
        "candidates",
    }
    assert written["verdict"]["effects"] == ["coulomb_friction", "torque_delay"]
    assert written["verdict"]["confusable_with"]["coulomb_friction"] == ["presliding_friction"]
    assert set(written["verdict"]["candidates"][0]) >= {"effect", "delta_bic", "holdout_rate_rms"}
    assert written["noise_floor"]["source"] == "given"


@pytest.mark.parametrize("model", ["before", "after"])
def test_every_parameter_stands_with_its_unit_error_and_interval(written: dict[str, Any], model: str) -> None:
    inertia = written[model]["parameters"]["inertia"]
    assert inertia["unit"] == "kg*m^2"
    assert inertia["ci95"][0] < inertia["value"] < inertia["ci95"][1]
    assert inertia["std_error"] > 0.0


def test_effect_parameters_stand_below_their_effect(written: dict[str, Any]) -> None:
    level = written["after"]["effect_parameters"]["coulomb_friction"]["level"]
    assert (level["value"], level["unit"]) == (1.1998, "N*m")


def test_errors_have_the_same_keys_before_and_after(written: dict[str, Any]) -> None:
    assert set(written["before"]["error"]) == set(written["after"]["error"])
    assert set(written["before"]["error"]) >= {
        "residual_rms_torque",
        "holdout_rate_rms",
        "holdout_fit_percent",
        "residual_torque_relative",
        "holdout_torque_relative",
    }


def test_each_set_says_what_it_determines(written: dict[str, Any]) -> None:
    last = written["per_set"][-1]
    assert last["frequency_hz"] == 9.0
    assert last["identifiable"] == ["inertia", "stiffness"]
    assert "damping" not in last["parameters"]
    assert set(last) >= {"objective", "restarts", "accepted"}


def test_max_error_stands_with_the_sets_and_the_totals_where_the_truth_was_given(written: dict[str, Any]) -> None:
    assert written["max_error_percent"]["inertia"] == 0.0024
    assert set(written["per_set"][0]["max_error_percent"]) == {"inertia", "damping", "stiffness"}


def test_without_a_reference_nothing_speaks_of_max_error() -> None:
    assert "max_error_percent" not in json.dumps(result_json(unhappy()))


def test_what_is_dropped_or_undetermined_is_listed_with_its_reason() -> None:
    after = result_json(unhappy())["after"]
    assert after["dropped"] == [{"name": "damping", "reason": "its interval spans zero"}]
    assert after["not_determined"][0]["name"] == "stiffness_over_inertia"


def test_after_is_null_where_nothing_was_added_or_dropped(found: Identification) -> None:
    assert result_json(replace(found, after=None))["after"] is None


def test_nan_and_infinity_become_null(found: Identification) -> None:
    wild = replace(estimate(1.0, float("nan")), ci95=(-np.inf, np.inf))
    errors = Errors(float("nan"), np.float64("inf"), None, None, None, None)  # type: ignore[arg-type]
    odd = with_final(found, parameters={"inertia": wild}, error=errors)
    after = json.loads(json.dumps(result_json(odd), allow_nan=False))["after"]
    assert after["parameters"]["inertia"]["std_error"] is None
    assert after["parameters"]["inertia"]["ci95"] == [None, None]
    assert after["error"]["residual_rms_torque"] is None
    assert after["error"]["holdout_rate_rms"] is None


def test_the_history_of_the_search_is_left_to_the_report(written: dict[str, Any]) -> None:
    assert "history" not in written["genetic"]
    assert written["genetic"]["generations"] == 200


def test_model_yaml_declares_the_very_platform_that_was_identified(found: Identification) -> None:
    section = ModelConfig.model_validate(yaml.safe_load(model_text(found, DECLARED)))
    assert section.platform() == TRUTH


def test_what_is_lost_says_whether_its_number_is_the_declared_one(found: Identification) -> None:
    lost = (NotReported("inertia", "one tone gives two numbers", True), NotReported("stiffness", "it is tied"))
    text = model_text(with_final(found, not_determined=lost), DECLARED)
    assert "# Not determined, kept as declared: inertia: one tone gives two numbers" in text
    assert "# Not determined, NOT as declared: " in text and ": stiffness: it is tied" in text


def test_a_dropped_term_is_no_longer_part_of_the_model(found: Identification) -> None:
    dropped = (NotReported("stiffness", "nothing pulls back"),)
    odd = with_final(found, dropped=dropped, platform=Platform(0.02, 0.2, 0.0, terms=("inertia", "damping")))
    assert yaml.safe_load(model_text(odd, DECLARED))["terms"] == ["inertia", "damping"]
    assert "# Dropped: stiffness: nothing pulls back" in model_text(odd, DECLARED)


RATIOS = Platform(
    1.0, 2.2, 300.0,
    {
        "unbalance": {"sine": 33.0, "cosine": 0.5},
        "stribeck_friction": {"coulomb": 1.0, "static": 2.0, "speed": 0.08},
        "flexible_mode": {"inertia": 0.1, "frequency": 12.0, "ratio": 0.01},
        "load_dependent_friction": {"factor": 0.3},
        "rate_bias": {"bias": 0.02},
        "torque_saturation": {"limit": 40.0},
    },
)  # fmt: skip


def test_without_torque_the_declared_inertia_sets_the_scale_of_all_that_is_a_torque(found: Identification) -> None:
    decay = replace(with_final(found, platform=RATIOS), torque_free=True)
    made = final_platform(decay, DECLARED)
    j = DECLARED.inertia_kg_m2
    assert (made.inertia_kg_m2, made.damping_nm_s_rad, made.stiffness_nm_rad) == (j, j * 2.2, j * 300.0)
    assert made.effects == {
        "unbalance": {"sine": j * 33.0, "cosine": j * 0.5},
        "stribeck_friction": {"coulomb": j, "static": j * 2.0, "speed": 0.08},
        "flexible_mode": {"inertia": j * 0.1, "frequency": 12.0, "ratio": 0.01},
        "load_dependent_friction": {"factor": 0.3},
        "rate_bias": {"bias": 0.02},
        "torque_saturation": {"limit": 40.0},
    }


def test_without_torque_the_scale_is_said_also_where_no_ratio_stands_in_the_tables(found: Identification) -> None:
    decay = replace(with_final(found, platform=RATIOS, parameters={}), torque_free=True)
    assert "the declared inertia sets the scale" in model_text(decay, DECLARED)
    assert "in proportion to the declared inertia of 0.0185 kg m^2" in model_text(decay, DECLARED)


def test_without_torque_and_without_a_declared_inertia_nothing_in_n_m_is_made_up(found: Identification) -> None:
    decay = replace(with_final(found, platform=RATIOS), torque_free=True)
    text = model_text(decay, DECLARED, inertia_declared=False)
    assert "# ONLY RATIOS TO THE INERTIA ARE KNOWN" in text
    assert ModelConfig.model_validate(yaml.safe_load(text)).platform() == RATIOS
    assert yaml.safe_load(text)["inertia_unknown"] is True


def test_a_reason_of_several_lines_cannot_break_out_of_its_comment(found: Identification) -> None:
    odd = with_final(found, not_determined=(NotReported("damping", "first\ninertia_kg_m2: 99"),))
    assert yaml.safe_load(model_text(odd, DECLARED))["inertia_kg_m2"] != 99


def test_the_folder_gets_all_files_and_nothing_half_written(
    found: Identification, recording: Recording, tmp_path: Path
) -> None:
    written = write_results(tmp_path, found, recording, DECLARED, "default")
    assert [path.name for path in written] == [
        "model.yaml",
        "result.json",
        "recording.h5",
        "report.html",
        "report_data.h5",
    ]
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in written}
    assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["accepted"] is True


def test_a_recording_that_stands_there_already_is_left_alone(
    found: Identification, recording: Recording, tmp_path: Path
) -> None:
    (tmp_path / "recording.h5").write_bytes(b"as it was played")
    write_results(tmp_path, found, recording, DECLARED, "default")
    assert (tmp_path / "recording.h5").read_bytes() == b"as it was played"


def test_numbers_that_no_model_may_have_give_no_model_yaml(
    found: Identification, recording: Recording, tmp_path: Path
) -> None:
    odd = with_final(found, platform=replace(TRUTH, inertia_kg_m2=-0.02))
    written = write_results(tmp_path, odd, recording, DECLARED, "default")
    assert [path.name for path in written] == ["result.json", "recording.h5", "report.html", "report_data.h5"]


def test_a_disk_that_has_no_room_for_the_report_has_the_numbers(
    found: Identification, recording: Recording, tmp_path: Path
) -> None:
    (tmp_path / "report.html").mkdir()
    with pytest.raises(OSError, match=r"report\.html"):
        write_results(tmp_path, found, recording, DECLARED, "default")
    assert not list(tmp_path.glob("*.part"))
    assert {path.name for path in tmp_path.iterdir()} == {"model.yaml", "result.json", "recording.h5", "report.html"}
    assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["accepted"] is True


def test_a_folder_that_cannot_be_written_leaves_no_partial_file(
    found: Identification, recording: Recording, tmp_path: Path
) -> None:
    (tmp_path / "result.json").mkdir()
    with pytest.raises(OSError, match=r"result\.json"):
        write_results(tmp_path, found, recording, DECLARED, "default")
    assert not list(tmp_path.glob("*.part"))
    assert not (tmp_path / "report.html").exists()


def test_the_residual_stands_with_shares_chance_and_words_before_and_after() -> None:
    found, _ = sample(2.0)
    told = json.loads(json.dumps(result_json(found), allow_nan=False))["residual"]
    assert told["before"]["harmonics"]["odd"]["share"] > 10.0 * told["before"]["harmonics"]["odd"]["by_chance"]
    assert told["before"]["direction"]["share"] > 0.3
    assert told["after"]["free_lines"] == []
    assert len(told["after"]["sentences"]) == 1
    assert result_json(replace(found, residual_before=None, after=None, residual_after=None))["residual"] == {
        "before": None, "after": None
    }  # fmt: skip
