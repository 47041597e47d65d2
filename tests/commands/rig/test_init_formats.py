"""`rig init` on recordings in the formats of other tools: read at the first try, or refused with the cure."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from commands.rig.app import app
from rig.config.load import load_config
from rig.recording.extra_readers import packages
from rig.recording.load import read_recording
from rig.recording.readers import read_file, suffixes
from rig.recording.run import Run
from tests.commands.rig import exported, exported_matlab, exported_more, exported_more_text
from tests.commands.rig.exported_text import ANGLE, RATE, TIME, TORQUE
from tests.commands.support import command


def writer(text: str) -> Callable[[Path], None]:
    return lambda path: (None, path.write_text(text, encoding="utf-8"))[0]


TEXTS = {file: (writer(text), options) for file, (text, options) in exported_more_text.FILES.items()}
READ = {**exported.READ, **exported_matlab.READ, **exported_more.READ, **TEXTS}


def read(folder: Path, file: str) -> Run:
    """The run that the configuration written for ``file`` reads."""
    make, options = READ[file]
    make(folder / file)
    done = command(app, "init", folder / file, "--out", folder / "rig.yaml", *options)
    assert done.exit_code == 0, done.stderr
    return read_recording(load_config(folder / "rig.yaml")).runs[0]


@pytest.mark.parametrize("file", READ)
def test_a_file_of_another_tool_is_read_at_the_first_try(file: str, tmp_path: Path) -> None:
    run = read(tmp_path, file)
    np.testing.assert_allclose(run.time_s - run.time_s[0], TIME, atol=1e-6)
    assert run.torque_nm is not None
    np.testing.assert_allclose(run.torque_nm, TORQUE, atol=1e-6)
    for values, expected in ((run.rate_rad_s, RATE), (run.angle_rad, ANGLE)):
        if values is not None:
            np.testing.assert_allclose(values, expected, atol=1e-6)
    assert run.rate_rad_s is not None or run.angle_rad is not None


def test_a_file_of_a_ros_2_bag_stands_for_the_bag_and_alone_is_refused_with_the_cure(tmp_path: Path) -> None:
    exported.ros2(tmp_path / "bag")
    (inside,) = (tmp_path / "bag").glob("*.db3")
    (table,) = read_file(inside)
    assert not isinstance(table, Run) and "joint_states.effort[axis1]" in table.names
    shutil.copy(inside, tmp_path / "alone.db3")
    done = command(app, "init", tmp_path / "alone.db3", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    assert "metadata.yaml of the bag is missing" in done.stderr and "ros2 bag reindex" in done.stderr


def test_a_log_of_raw_can_frames_is_refused_with_what_decodes_it(tmp_path: Path) -> None:
    exported.mf4_can(tmp_path / "bus.mf4")
    done = command(app, "init", tmp_path / "bus.mf4", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    assert "raw CAN frames" in done.stderr and "extract_bus_logging" in done.stderr


FRAMES = {
    "vector.asc": "date Mon May 6 02:03:07.000 pm 2024\nbase hex  timestamps absolute\ninternal events logged\n"
    "// version 9.0.0\n   0.000000 Start of measurement\n"
    + "".join(f"   0.{i:03}000 1  201             Rx   d 8 01 02 03 04 05 06 07 08\n" for i in range(60)),
    "candump.log": "".join(f"(22446.62{i}534) can0 601#4000100000000000\n" for i in range(10)),
    "vector.blf": "LOGG",
}


@pytest.mark.parametrize("file", FRAMES)
def test_a_log_of_frames_of_another_kind_is_told_once(file: str, tmp_path: Path) -> None:
    (tmp_path / file).write_text(FRAMES[file])
    done = command(app, "init", tmp_path / file, "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    assert "holds raw CAN frames and no signals: decode it with the DBC file first (CANalyzer" in done.stderr
    assert done.stderr.count(file) == 1


@pytest.mark.parametrize("file", ["x.parquet", "x.mf4", "x.tdms", "x.bag", "x.xlsx", "x.ods"])
def test_a_damaged_file_is_refused_without_a_traceback(file: str, tmp_path: Path) -> None:
    (tmp_path / file).write_bytes(b"\x00not what it says" * 40)
    done = command(app, "init", tmp_path / file, "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2, done.output
    assert "again" in done.stderr and "Traceback" not in done.output
    assert [p.name for p in tmp_path.iterdir()] == [file]


@pytest.mark.parametrize(
    ("file", "extra"),
    [("x.parquet", "parquet"), ("x.mf4", "mf4"), ("x.tdms", "tdms"), ("x.bag", "rosbag"), ("x.xlsx", "xlsx")],
)
def test_where_a_format_needs_a_package_its_extra_is_named(
    file: str, extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(packages, "find_spec", lambda name: None)
    (tmp_path / file).write_bytes(b"x")
    done = command(app, "init", tmp_path / file, "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    assert f"pip install 'isp-rig[{extra}]'" in done.stderr


def test_channels_of_a_faster_group_lose_readings_and_none_are_made_up(tmp_path: Path) -> None:
    exported.mf4_rasters(tmp_path / "two.mf4")
    (table,) = read_file(tmp_path / "two.mf4")
    assert not isinstance(table, Run)
    assert table.names == ("time_s", "Torque", "Rate", "T_winding")
    values = table.read(table.names)
    assert {len(v) for v in values.values()} == {len(TIME)}
    np.testing.assert_allclose(values["T_winding"][:50], 20.0 + TIME[:50], atol=1e-9)


def test_a_time_that_follows_from_the_heading_is_told(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(exported_more_text.FILES["yokogawa.csv"][0], encoding="utf-8")
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml")
    assert "Of r.csv, the rows have no time: by the heading they begin at 0 s and are 0.002 s apart" in done.stdout


def test_of_two_rates_the_one_that_is_neither_torque_nor_motion_is_joined(tmp_path: Path) -> None:
    exported_matlab.control_desk(tmp_path / "r.mat")
    (table,) = read_file(tmp_path / "r.mat")
    assert not isinstance(table, Run) and table.names == ("time", "Torque_act", "Gyro_rate", "T_motor")
    values = table.read(table.names)
    assert {len(v) for v in values.values()} == {len(TIME)}
    np.testing.assert_allclose(values["T_motor"][:390], 20.0 + TIME[:390], atol=1e-9)


def test_an_object_of_matlab_is_refused_with_what_saves_it(tmp_path: Path) -> None:
    exported_matlab.with_an_object(tmp_path / "r.mat")
    done = command(app, "init", tmp_path / "r.mat", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    assert "'T' is an object of MATLAB" in done.stderr and "w = T.w" in done.stderr


def test_every_suffix_that_is_read_is_in_the_docs() -> None:
    page = (Path(__file__).parents[3] / "docs" / "recordings.md").read_text(encoding="utf-8")
    assert [s for s in suffixes() if f"`{s}`" not in page and f"{s}`" not in page] == []
