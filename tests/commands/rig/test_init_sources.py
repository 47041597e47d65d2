"""`rig init` on files without a time, with volts alone, on several files, and on files that are not there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from commands.rig.app import app
from commands.rig.init import InitOptions, init
from rig.config.load import load_config
from rig.recording.hdf5 import write_recording_h5
from rig.recording.load import read_recording
from rig.recording.run import Recording, Run
from rig.recording.table import Table
from rig.recording.tables import columns_of
from tests.commands.rig.exported_text import ANGLE, RATE, TIME, TORQUE, rows
from tests.commands.rig.test_init import GOOD, agrees, made
from tests.commands.support import command

NO_TIME = "torque_nm,rate_deg_s\n" + rows(TORQUE, np.degrees(RATE))


def npz(path: Path, **single: float) -> None:
    np.savez(path, torque_nm=TORQUE, rate_rad_s=RATE, **{name: np.float64(value) for name, value in single.items()})


def test_a_file_without_a_time_is_read_with_the_sample_rate_that_somebody_gives(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(NO_TIME, encoding="utf-8")
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    assert done.stderr.count("  time:") == 1
    assert "no column is a time: give --time COL, or --sample-rate HZ if the rows are evenly spaced" in done.stderr
    agrees(made(tmp_path, "r.csv", "--sample-rate", "500"))
    assert "  sample_rate_hz: 500" in (tmp_path / "rig.yaml").read_text(encoding="utf-8")


def test_stamps_that_repeat_are_replaced_by_a_sample_rate(tmp_path: Path) -> None:
    coarse = np.floor(TIME * 10.0) / 10.0
    text = "time_s,torque_nm,rate_rad_s\n" + rows(coarse, TORQUE, RATE)
    (tmp_path / "r.csv").write_text(text, encoding="utf-8")
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    assert "give --time COL, or --sample-rate HZ if the rows are evenly spaced" in done.stderr
    agrees(made(tmp_path, "r.csv", "--sample-rate", "500"))


@pytest.mark.parametrize("name", ["Fs", "sample_rate", "samplingRate_Hz", "dt", "Ts", "sample_time_s"])
def test_a_sample_rate_in_the_file_is_proposed(name: str, tmp_path: Path) -> None:
    npz(tmp_path / "r.npz", **{name: 0.002 if name.lower().startswith(("dt", "ts", "sample_time")) else 500.0})
    done = command(app, "init", tmp_path / "r.npz", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    assert f"sample rate '500 Hz' is a guess ('{name}' in the file says so)" in done.stderr
    agrees(made(tmp_path, "r.npz", "--yes"))
    assert "sample_rate_hz: 500  # GUESS" in (tmp_path / "rig.yaml").read_text(encoding="utf-8")


def test_a_sample_rate_of_matlab_gives_the_step_of_a_counter(tmp_path: Path) -> None:
    count = np.delete(np.arange(len(TIME)), 7).astype(float)
    kept = count.astype(int)
    savemat(tmp_path / "r.mat", {"sample": count, "torque_nm": TORQUE[kept], "rate_rad_s": RATE[kept], "Fs": 500.0})
    for options in (["--yes", "--time", "sample", "--time-scale", "0.002"], ["--sample-rate", "500"]):
        run = made(tmp_path, "r.mat", *options)
        np.testing.assert_allclose(run.time_s, TIME[kept], atol=1e-12)
        (tmp_path / "rig.yaml").unlink()


def test_angle_and_rate_say_each_others_unit_without_a_time_too(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("torque_nm,w,phi\n" + rows(TORQUE, RATE, np.degrees(ANGLE)), encoding="utf-8")
    agrees(made(tmp_path, "r.csv", "--sample-rate", "500"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--sample-rate", "fast"], "--sample-rate 'fast' is not allowed: give the rows a second"),
        (["--sample-rate", "0"], "a number above 0"),
        (["--sample-rate", "500", "--time", "time_s"], "--sample-rate and --time were both given"),
        (["--sample-rate", "500", "--time-scale", "ms"], "--sample-rate and --time-scale were both given"),
    ],
)
def test_a_sample_rate_that_cannot_be_used_is_refused(options: list[str], words: str, tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(GOOD, encoding="utf-8")
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml", *options)
    assert done.exit_code == 2 and words in done.stderr
    assert not (tmp_path / "rig.yaml").exists()


def answering(*answers: str) -> tuple[list[str], Callable[[str], str]]:
    """The questions that will have been asked, and what gives the answers in turn."""
    asked: list[str] = []
    left = iter(answers)

    def ask(question: str) -> str:
        asked.append(question)
        return next(left)

    return asked, ask


def test_on_a_terminal_the_sample_rate_is_asked(tmp_path: Path) -> None:
    npz(tmp_path / "r.npz", fs=500.0)
    asked, ask = answering("often", "")
    assert init([tmp_path / "r.npz"], InitOptions(out=tmp_path / "rig.yaml"), ask) == 0
    assert len(asked) == 2 and "How many rows a second, in Hz" in asked[0] and asked[0].endswith("[500] ")
    agrees(read_recording(load_config(tmp_path / "rig.yaml")).runs[0])


@pytest.mark.parametrize("angle_alone", [False, True])
def test_on_a_terminal_a_file_of_volts_alone_is_asked_through(angle_alone: bool, tmp_path: Path) -> None:
    values = ANGLE if angle_alone else RATE
    (tmp_path / "r.csv").write_text("t [s],a [V],b [V]\n" + rows(TIME, TORQUE / 2, values / 3), encoding="utf-8")
    which = ["none", "a [V]", "b [V]"] if angle_alone else ["b [V]", "a [V]"]
    asked, ask = answering(*which, "2", "3")
    assert init([tmp_path / "r.csv"], InitOptions(out=tmp_path / "rig.yaml"), ask) == 0
    assert "no rate and no angle was recognised (not used, but they move: 'a [V]', 'b [V]')" in asked[0]
    agrees(read_recording(load_config(tmp_path / "rig.yaml")).runs[0])


def test_several_files_become_several_runs(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text(GOOD, encoding="utf-8")
    (tmp_path / "c.csv").write_text(NO_TIME, encoding="utf-8")
    for i, sources in enumerate([[tmp_path / "a.csv", tmp_path / "b.csv"], [tmp_path / "[ab].csv"]]):
        out = tmp_path / f"{i}.yaml"
        assert command(app, "init", *sources, "--out", out).exit_code == 0
        assert [run.name for run in read_recording(load_config(out)).runs] == ["a.csv", "b.csv"]
    done = command(app, "init", tmp_path / "a.csv", tmp_path / "c.csv", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2 and "c.csv: has no column 'time_s'" in done.stderr
    assert not (tmp_path / "rig.yaml").exists()


def test_a_file_that_is_not_there_is_said_without_a_word_of_a_configuration(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(GOOD, encoding="utf-8")
    done = command(app, "init", tmp_path / "b.csv", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    assert "b.csv: no such file: correct the path; there are: a.csv" in done.stderr and "yaml" not in done.stderr
    done = command(app, "init", tmp_path / "*.npz", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2 and "no file fits the pattern" in done.stderr


def test_the_help_names_the_formats() -> None:
    text = " ".join(command(app, "init", "--help").stdout.replace("│", " ").split())
    for word in (".lvm", "NPZ", "HDF5", "Parquet", "MDF4", "TDMS", "ROS bags", "JSON", "--sample-rate"):
        assert word in text


def test_rows_of_a_long_file_keep_their_place_in_time(tmp_path: Path) -> None:
    table = Table(tmp_path, ("torque_nm",), lambda names: dict.fromkeys(names, TORQUE[100:]), first_row=100)
    (tmp_path / "rig.yaml").write_text(
        "backend: recorded\nrecorded:\n  sample_rate_hz: 500\n  columns: {rate: torque_nm, torque: none}\n"
        "  runs: [{file: a}]\n"
    )
    section = load_config(tmp_path / "rig.yaml").config.recorded
    assert section is not None
    np.testing.assert_allclose(columns_of(table, {"time": 1.0, "rate": 1.0}, section)["time"], TIME[100:], atol=1e-12)


@pytest.mark.parametrize("key", ["columns: {time: t}", "scale: {time: 0.001}"])
def test_a_sample_rate_and_a_time_are_not_both_allowed(key: str, tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(
        f"backend: recorded\nrecorded: {{sample_rate_hz: 500, {key}, runs: [{{file: a.csv}}]}}\n"
    )
    with pytest.raises(Exception, match=r"sample_rate_hz and .*time are both given"):
        load_config(tmp_path / "rig.yaml")


def test_a_recording_of_this_program_takes_no_sample_rate(tmp_path: Path) -> None:
    run = Run("set 1", TIME, np.ones(len(TIME), bool), RATE, torque_time_s=TIME, torque_nm=TORQUE)
    write_recording_h5(tmp_path / "recording.h5", Recording((run,)))
    done = command(app, "init", tmp_path / "recording.h5", "--out", tmp_path / "rig.yaml", "--sample-rate", "500")
    assert done.exit_code == 2 and "leave out --sample-rate" in done.stderr
