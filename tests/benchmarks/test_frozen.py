"""The frozen recordings hold every effect once, and a comparison of two results tells what changed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from benchmarks.frozen.__main__ import main
from benchmarks.frozen.comparison import compare, differences
from benchmarks.frozen.recordings import record, simulated
from rig import effects

RESULT: dict[str, Any] = {
    "schema_version": 1,
    "accepted": True,
    "before": {"parameters": {"inertia": {"value": 0.02, "ci95": [0.019, 0.021]}}, "dropped": []},
    "note": "read from /one/folder/run1.csv",
}


def changed(**more: Any) -> dict[str, Any]:
    return RESULT | more


def test_every_effect_of_the_library_is_frozen_once_and_thirty_recordings_need_no_measured_set() -> None:
    every = {form for name in effects.names() for form in (name, *effects.forms(name))}
    assert every <= set(simulated())
    assert len(simulated()) >= 30


def test_a_recording_is_the_same_each_time_and_holds_a_few_thousand_samples(tmp_path: Path) -> None:
    few = ("creep", "torque_scale", "decay")
    assert record(tmp_path / "one", few) == list(few) == record(tmp_path / "two", few)
    for name in few:
        text = (tmp_path / "one" / name / "rig.yaml").read_text(encoding="utf-8")
        assert text == (tmp_path / "two" / name / "rig.yaml").read_text(encoding="utf-8")
        files = [run["file"] for run in yaml.safe_load(text)["recorded"]["runs"]]
        assert files
        for file in files:
            assert (tmp_path / "one" / name / file).read_bytes() == (tmp_path / "two" / name / file).read_bytes()
    with np.load(tmp_path / "one" / "decay" / "run1.npz") as decay:
        assert set(decay) == {"time_s", "angle_rad"}
        assert 1000 < len(decay["time_s"]) < 5000


def test_equal_results_have_no_difference_whatever_their_version_and_folders() -> None:
    assert differences(RESULT, changed(schema_version=2, note="read from /another/run1.csv")) == []


@pytest.mark.parametrize(
    ("after", "place"),
    [
        ({"accepted": 1}, "accepted: True -> 1"),
        ({"before": {"parameters": {"inertia": {"value": 0.02, "ci95": [0.019, 0.0211]}}, "dropped": []}},
         "before.parameters.inertia.ci95[1]: 0.021 -> 0.0211"),
        ({"before": {"parameters": {}, "dropped": []}}, "before.parameters.inertia.value: 0.02 -> '(missing)'"),
        ({"note": "read from run2.csv"}, "note: 'read from run1.csv' -> 'read from run2.csv'"),
    ],
)  # fmt: skip
def test_what_changed_is_listed_with_its_place(after: dict[str, Any], place: str) -> None:
    assert place in differences(RESULT, changed(**after))


def test_a_key_that_was_renamed_on_purpose_is_no_difference_if_its_values_are_the_same() -> None:
    after = {k: v for k, v in RESULT.items() if k != "before"} | {"declared_model": RESULT["before"]}
    assert differences(RESULT, after, {"before": "declared_model"}) == []
    assert differences(RESULT, after) != []


def test_the_command_counts_differences_and_missing_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    for folder, result in ((one, RESULT), (two, changed(accepted=False))):
        folder.mkdir()
        (folder / "clean.json").write_text(json.dumps(result), encoding="utf-8")
    assert main(["compare", str(one), str(one)]) == 0
    assert main(["compare", str(one), str(two)]) == 1
    assert "clean: accepted: True -> False\n1 differences in 1 results" in capsys.readouterr().out
    (one / "decay.json").write_text(json.dumps(RESULT), encoding="utf-8")
    both, lines = compare(one, two)
    assert (both, len(lines)) == (1, 2)
    assert f"decay: no result in {two}" in lines
