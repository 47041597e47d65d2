"""Further columns: declared in rig.yaml, read from every format, kept in recording.h5, refused with a cure."""

from __future__ import annotations

import gzip
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from rig import effects
from rig.channels import Channel
from rig.config.load import load_config
from rig.errors import ConfigError
from rig.recording.hdf5 import read_recording_h5, write_recording_h5
from tests.rig.recording.support import csv_of, motion, read, refusal

DECLARED = """  columns:
    channels:
      winding: {column: T1, kind: temperature}
      motor_current: {column: I, kind: current, scale: 0.001, torque_constant_nm_a: 0.35}
"""


def columns() -> dict[str, Any]:
    plain = motion()
    return plain | {"T1": 21.0 + plain["time_s"], "I": 1000.0 * plain["torque_nm"] / 0.35}


def write(path: Path, values: dict[str, Any]) -> None:
    if path.name.endswith(".csv.gz"):
        path.write_bytes(gzip.compress(csv_of(values).encode()))
    elif path.suffix == ".csv":
        path.write_text(csv_of(values))
    elif path.suffix == ".npz":
        np.savez(path, **values)
    elif path.suffix == ".mat":
        scipy.io.savemat(path, values)
    else:
        with h5py.File(path, "w") as file:
            for name, x in values.items():
                file[name] = x


@pytest.mark.parametrize("file", ["a.csv", "a.csv.gz", "a.npz", "a.mat", "a.h5"])
def test_a_further_column_is_read_from_every_format_in_its_own_unit(tmp_path: Path, file: str) -> None:
    write(tmp_path / file, columns())
    run = read(tmp_path, file, DECLARED).runs[0]
    np.testing.assert_allclose(run.channels["winding"], columns()["T1"])
    np.testing.assert_allclose(run.channels["motor_current"], columns()["I"] / 1000.0)
    assert run.causes["winding"] == Channel("winding", "temperature", factor=1.0)
    assert run.causes["motor_current"] == Channel("motor_current", "current", factor=0.35)


def test_a_window_cuts_the_channels_with_the_samples(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", columns())
    run = read(tmp_path, "a.csv", DECLARED, "      from_s: 0.1\n      to_s: 0.3\n").runs[0]
    assert len(run.channels["winding"]) == len(run.time_s)
    assert run.channels["winding"][0] == pytest.approx(21.1)


def test_a_channel_may_lack_readings_where_a_sample_is_valid(tmp_path: Path) -> None:
    values = columns()
    values["T1"] = np.where(np.arange(500) % 100 == 0, values["T1"], np.nan)
    (tmp_path / "a.csv").write_text(csv_of(values).replace("nan", ""))
    run = read(tmp_path, "a.csv", DECLARED).runs[0]
    assert np.isfinite(run.channels["winding"]).sum() == 5
    assert run.valid.all()


def test_what_a_channel_is_survives_recording_h5_and_our_own_file_is_read_with_it(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", columns())
    before = read(tmp_path, "a.csv", DECLARED)
    write_recording_h5(tmp_path / "own.h5", before)
    after = read_recording_h5(tmp_path / "own.h5")
    assert after.runs[0].causes == before.runs[0].causes
    np.testing.assert_array_equal(after.runs[0].channels["winding"], before.runs[0].channels["winding"])
    assert read(tmp_path, "own.h5").runs[0].causes == before.runs[0].causes


def test_a_column_that_is_not_there_is_said_with_the_nearest_and_the_key(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", columns())
    said = refusal(tmp_path, "a.csv", "  columns: {channels: {winding: {column: T11, kind: temperature}}}\n")
    assert "has no column 'T11', did you mean 'T1'?" in said
    assert "correct recorded.columns.channels.winding" in said


def test_an_empty_or_a_wild_channel_is_refused_with_its_key_or_line(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", columns() | {"T1": np.full(500, np.nan)})
    assert "channel 'winding' has 0 readings that are numbers" in refusal(tmp_path, "a.csv", DECLARED)
    wild = columns()
    wild["T1"][3] = 3e29
    write(tmp_path / "a.csv", wild)
    assert "line 5: channel 'winding' is 3e+29" in refusal(tmp_path, "a.csv", DECLARED)


@pytest.mark.parametrize(
    ("channels", "said"),
    [
        ("{winding: {kind: warmth}}", r"channels\.winding\.kind: 'warmth' is not allowed: has to be 'current', 'temp"),
        ("{winding: {column: T1}}", r"channels\.winding\.kind: is required and missing"),
        ("{Winding 1: {kind: other}}", r"'Winding 1' is not a name for a channel: lower-case letters"),
        ("{cubic: {kind: other}}", r"a channel 'cubic' would make an effect 'cubic_stiffness', and there is one"),
        ("{a: {kind: other, column: T}, b: {kind: other, column: T}}", r"column 'T' is used for two quantities"),
        ("{w: {kind: temperature, torque_constant_nm_a: 1}}", r"torque_constant_nm_a belongs to kind: current"),
        ("{w: {kind: other, scale: 0}}", r"a factor of 0 sets every value to 0"),
        ("{w: {kind: other, colum: T}}", r"unknown key 'colum', did you mean 'column'"),
        ("{" + ", ".join(f"x{i}: {{kind: other}}" for i in range(9)) + "}", r"9 channels, at most 8 are allowed"),
    ],
)  # fmt: skip
def test_a_wrong_declaration_is_said_with_its_key_and_what_is_allowed(tmp_path: Path, channels: str, said: str) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(f"backend: recorded\nrecorded:\n  columns:\n    channels: {channels}\n  runs: [{{file: a.csv}}]\n")
    with pytest.raises(ConfigError, match=said) as error:
        load_config(path)
    assert re.match(rf"{path}:[34]: ", str(error.value))


def test_an_effect_of_a_declared_channel_is_a_candidate_like_any_other(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(
        f"backend: recorded\nrecorded:\n{DECLARED}  runs: [{{file: a.csv}}]\n"
        "identify: {candidates: [stiffness_drift, winding_stiffness]}\n"
    )
    assert load_config(path).config.identify.candidates == ("stiffness_drift", "winding_stiffness")
    assert effects.get("winding_stiffness").parameters[0].key == "slope_nm_rad_per_k"


def test_a_number_for_no_reading_of_a_channel_is_missing_and_told(tmp_path: Path) -> None:
    values = columns()
    values["T1"] = np.where(np.arange(500) % 50, values["T1"], -9999.0)
    write(tmp_path / "a.csv", values)
    run = read(tmp_path, "a.csv", DECLARED).runs[0]
    assert np.isnan(run.channels["winding"][::50]).all() and run.valid.all()
    assert run.notes == ("channel winding has -9999 for no reading, 10 times",)
