"""Whatever is wrong with a file, the command says the cause and the cure, ends in 2 or 1, and shows no traceback."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from typer.testing import Result

from commands.identify_run.app import app
from tests.commands.support import command
from tests.rig.config.test_malformed import CASES as CONFIGS
from tests.rig.recording.test_malformed_files import TEXTS

RECORDED = "backend: recorded\nrecorded:\n  runs: [{file: run.csv}]\n"
N = 600
T = np.arange(N) * 1e-3
RATE = 0.1 * np.sin(20.0 * T) + 1e-3 * np.random.default_rng(1).standard_normal(N)

# Readable and sound as files, but nothing, or not everything, can be learnt from them.
EMPTY_OF_CONTENT: Mapping[str, Mapping[str, np.ndarray]] = {
    "two samples": {"time_s": T[:2], "torque_nm": T[:2], "rate_rad_s": T[:2]},
    "constant torque, constant rate": {"time_s": T, "torque_nm": np.ones(N), "rate_rad_s": np.ones(N)},
    "nothing moves": {"time_s": T, "torque_nm": np.sin(20.0 * T), "rate_rad_s": np.zeros(N)},
    "noise alone": {"time_s": T, "torque_nm": np.zeros(N), "rate_rad_s": np.random.default_rng(2).standard_normal(N)},
    "one torque that never changes": {"time_s": T, "torque_nm": np.ones(N), "rate_rad_s": RATE},
}


def identify_run(folder: Path, text: str) -> Result:
    config = folder / "rig.yaml"
    config.write_text(text, encoding="utf-8")
    return command(app, config, "--quiet", "--out", folder / "out")


def assert_refused(done: Result, folder: Path) -> None:
    assert done.exit_code == 2, done.output
    assert done.stderr.startswith("Error: ")
    assert "Traceback" not in done.output
    assert not (folder / "out").exists()


@pytest.mark.parametrize("case", CONFIGS)
def test_a_malformed_configuration_ends_in_2_with_nothing_written(tmp_path: Path, case: str) -> None:
    done = identify_run(tmp_path, CONFIGS[case][0])
    assert_refused(done, tmp_path)
    assert str(tmp_path / "rig.yaml") in done.stderr


@pytest.mark.parametrize("case", TEXTS)
def test_a_malformed_recording_ends_in_2_with_nothing_written(tmp_path: Path, case: str) -> None:
    (tmp_path / "run.csv").write_text(TEXTS[case][0], encoding="utf-8")
    done = identify_run(tmp_path, RECORDED)
    assert_refused(done, tmp_path)
    assert "run.csv" in done.stderr


@pytest.mark.parametrize("case", EMPTY_OF_CONTENT)
def test_a_recording_that_tells_too_little_is_not_accepted(tmp_path: Path, case: str) -> None:
    columns = EMPTY_OF_CONTENT[case]
    rows = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header=",".join(columns), comments="")
    done = identify_run(tmp_path, RECORDED)
    assert done.exit_code in (1, 2), done.output
    assert done.stderr.strip() and "Traceback" not in done.output
