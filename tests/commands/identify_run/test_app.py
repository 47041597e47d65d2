"""`identify-run`: the way from a configuration to a results folder and an exit code, the identifier stubbed."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from commands.identify_run.app import app
from identify.results import Identification
from rig.config.identify import IdentifyConfig
from rig.errors import RecordingError
from rig.platform import Platform
from rig.recording.hdf5 import read_recording_h5
from rig.recording.run import Recording, Run
from tests.commands.identify_run.identifiers import Identifier
from tests.commands.support import TWO_SETS, command, write_config
from tests.identify.sample import sample

TRUTH = """
simulated:
  platform:
    inertia_kg_m2: 0.02345678
    damping_nm_s_rad: 0.0456789
    stiffness_nm_rad: 678.9012
    effects: {coulomb_friction: {level_nm: 0.123456789}}
"""
TRUE_NUMBERS = {0.02345678, 0.0456789, 678.9012, 0.123456789}
ALL_FILES = {"result.json", "report.html", "model.yaml", "recording.h5", "report_data.h5"}


def write_recording(folder: Path) -> Path:
    rows = "\n".join(f"{i / 100},{i % 7 - 3},{(i % 5) / 10}" for i in range(400))
    (folder / "a.csv").write_text(f"time_s,torque_nm,rate_rad_s\n{rows}\n")
    return write_config(folder, "backend: recorded\nrecorded: {runs: [{file: a.csv}]}\n")


def files_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_campaign_that_is_accepted_ends_in_0_with_all_results(tmp_path: Path, accepted: Identifier) -> None:
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), "--out", out)
    assert done.exit_code == 0, done.output
    assert files_in(out) >= ALL_FILES
    assert json.loads((out / "result.json").read_text())["accepted"] is True
    assert "Torque is SIMULATED" in done.stderr and "looking at the residual" in done.stderr
    assert "Coulomb friction is missing" in done.stdout and str(out) in done.stdout


def test_numbers_that_the_file_declares_stand_beside_the_fitted_ones_and_defaults_do_not(
    tmp_path: Path, accepted: Identifier
) -> None:
    model = "model: {inertia_kg_m2: 1.163, stiffness_nm_rad: 39030}\n"  # 57.3 times what is fitted
    done = command(app, write_config(tmp_path, f"{TWO_SETS}{model}"), "--out", tmp_path / "out")
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["declared"] == {"inertia": 1.163, "stiffness": 39030.0}
    assert result["plausibility"][0]["parameters"] == ["inertia", "stiffness"]
    assert "J and K are about 1/57 of the declared values" in " ".join(done.stdout.split())


def test_one_that_is_not_accepted_ends_in_1_with_all_results_and_the_reason(
    tmp_path: Path, stubbed: Callable[[Identification], Identifier]
) -> None:
    reason = "the residual stays unexplained: play a multisine"
    stubbed(dataclasses.replace(sample(1.0)[0], accepted=False, reasons=(reason,)))
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), "--quiet", "--out", out)
    assert done.exit_code == 1
    assert done.stdout == "" and reason in done.stderr
    assert files_in(out) >= ALL_FILES


def test_recordings_are_identified_without_anything_being_played(tmp_path: Path, accepted: Identifier) -> None:
    out = tmp_path / "out"
    done = command(app, write_recording(tmp_path), "--out", out)
    assert done.exit_code == 0, done.output
    assert "nothing moves" in done.stderr
    assert files_in(out) == ALL_FILES
    assert len(accepted.given[0][0].runs) == 1


def test_a_recording_that_the_identifier_refuses_ends_in_2_and_nothing_is_written(
    tmp_path: Path, stubbed: Callable[[BaseException], Identifier]
) -> None:
    stubbed(RecordingError("a.csv: constant torque with constant rate tells nothing: excite it"))
    out = tmp_path / "out"
    done = command(app, write_recording(tmp_path), "--out", out)
    assert done.exit_code == 2
    assert "excite it" in done.stderr
    assert not out.exists()


def test_the_identifier_gets_samples_and_the_declared_model_and_nothing_of_the_truth(
    tmp_path: Path, accepted: Identifier
) -> None:
    config = write_config(tmp_path, TWO_SETS.replace("simulated: {}\n", TRUTH))
    assert command(app, config, "--quiet", "--out", tmp_path / "out").exit_code == 0
    recording, declared, _ = accepted.given[0]
    assert declared == Platform()
    assert recording.info == {}
    assert {f.name for f in dataclasses.fields(recording)} == {"runs", "axis", "noise", "info"}
    assert TRUE_NUMBERS.isdisjoint(numbers_in(accepted.given[0]))
    # The folder keeps the whole configuration; only the identifier does not see it.
    assert "0.123456789" in read_recording_h5(tmp_path / "out" / "recording.h5").info["config_text"]


def numbers_in(thing: Any) -> set[float]:
    """All numbers in a value, samples of arrays left out: those are what was measured."""
    if isinstance(thing, float | int):
        return {float(thing)}
    if isinstance(thing, Run | Recording | Platform):
        return numbers_in(vars(thing))
    if isinstance(thing, IdentifyConfig):
        return numbers_in(thing.model_dump())
    if isinstance(thing, dict):
        return {n for value in thing.values() for n in numbers_in(value)}
    if isinstance(thing, list | tuple):
        return {n for value in thing for n in numbers_in(value)}
    return set()


def test_a_dry_run_simulates_whatever_the_file_says(tmp_path: Path, accepted: Identifier) -> None:
    config = write_config(tmp_path, TWO_SETS.replace("backend: simulated", "backend: bench") + "bench: {}\n")
    done = command(app, config, "--dry-run", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert "Torque is SIMULATED" in done.stderr


@pytest.mark.parametrize("arguments", [[], ["nowhere.yaml"], ["--frobnicate"]])
def test_bad_usage_ends_in_2_without_a_traceback(arguments: list[str]) -> None:
    done = command(app, *arguments)
    assert done.exit_code == 2
    assert "Traceback" not in done.output


def test_the_version_is_printed() -> None:
    done = command(app, "--version")
    assert (done.exit_code, done.stdout.split()[0]) == (0, "isp-rig")
