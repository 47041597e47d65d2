"""`rig init` reads files as other tools export them at the first try, or says what to give; what it writes works."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from commands.identify_run.app import app as identify_run
from commands.rig.app import app
from commands.rig.init import InitOptions, init
from commands.rig.init_target import free_name
from rig.config.load import load_config
from rig.errors import UsageError
from rig.recording.hdf5 import write_recording_h5
from rig.recording.load import read_recording
from rig.recording.run import Recording, Run
from tests.commands.rig.exported_text import ANGLE, FILES, RATE, TIME, TORQUE, german, rows, stamped
from tests.commands.support import command

GOOD = "time_s,torque_nm,rate_rad_s\n" + rows(TIME, TORQUE, RATE)


def made(folder: Path, file: str, *options: str) -> Run:
    """The run that the written configuration reads."""
    done = command(app, "init", folder / file, "--out", folder / "rig.yaml", *options)
    assert done.exit_code == 0, done.stderr
    assert str(folder / "rig.yaml") in done.stdout
    return read_recording(load_config(folder / "rig.yaml")).runs[0]


def agrees(run: Run) -> None:
    np.testing.assert_allclose(run.time_s - run.time_s[0], TIME, atol=1e-6)
    assert run.torque_nm is not None
    np.testing.assert_allclose(run.torque_nm, TORQUE, atol=1e-6)
    for values, expected in ((run.rate_rad_s, RATE), (run.angle_rad, ANGLE)):
        if values is not None:
            np.testing.assert_allclose(values, expected, atol=1e-6)


@pytest.mark.parametrize("file", FILES)
def test_a_file_is_read_at_the_first_try(file: str, tmp_path: Path) -> None:
    text, options = FILES[file]
    (tmp_path / file).write_bytes(text.encode("cp1252" if file == "windows.csv" else "utf-8"))
    agrees(made(tmp_path, file, *options))


def _h5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, values in (("time [ms]", 1e3 * TIME), ("torque [N m]", TORQUE), ("angle [deg]", np.degrees(ANGLE))):
            file[f"scope/{name}"] = values


def _h5_attributes(path: Path) -> None:
    columns = {"time": (1e3 * TIME, "ms"), "torque": (1e3 * TORQUE, np.bytes_("mN m")), "rate": (RATE, ["rad/s"])}
    with h5py.File(path, "w") as file:
        for (name, (values, unit)), key in zip(columns.items(), ("units", "unit", "Unit"), strict=True):
            file[f"log/{name}"] = values
            file[f"log/{name}"].attrs[key] = unit


BINARY: dict[str, Callable[[Path], None]] = {
    "run.npz": lambda p: np.savez(p, t=TIME, torque_Nm=TORQUE, gyro_deg_s=np.degrees(RATE), fs=500.0),
    "run.mat": lambda p: savemat(p, {"data": {"time_s": TIME, "torque_Nm": TORQUE, "omega_rad_s": RATE}, "note": "a"}),
    "run.h5": _h5,
    "attributes.h5": _h5_attributes,
}


@pytest.mark.parametrize("file", BINARY)
def test_arrays_of_other_formats_are_read_too(file: str, tmp_path: Path) -> None:
    BINARY[file](tmp_path / file)
    agrees(made(tmp_path, file))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "time (s),M,rate (rad/s)\n",
            ["torque: scale '1' is a guess (N m, as no unit is stated): give --torque-scale"],
        ),
        ("time (s),x1,x2\n", ["rate: column 'x2' is a guess", "give --rate COL", "torque: column 'x1' is a guess"]),
        (
            "time (s),current (A),rate (rad/s)\n",
            ["numbers are in 'A', which is no unit of torque", "--torque-scale FACTOR"],
        ),
        (
            "time (s),torque (N m),gyro (u)\n",
            ["its numbers are in 'u', which is no unit of rate", "--rate-scale FACTOR"],
        ),
    ],
)
def test_without_a_terminal_what_is_not_clear_is_named_with_its_option(
    text: str, words: list[str], tmp_path: Path
) -> None:
    (tmp_path / "r.csv").write_text(text + rows(TIME, TORQUE, RATE), encoding="utf-8")
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 2
    for word in (*words, "nothing was written"):
        assert word in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["r.csv"]


def test_guesses_that_were_taken_are_said_and_marked_in_the_file(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("time (s),M,rate (rad/s)\n" + rows(TIME, TORQUE, RATE), encoding="utf-8")
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml", "--yes")
    assert done.exit_code == 0
    assert "guess: torque: scale '1' (N m, as no unit is stated)" in done.stdout
    assert "'M': -" in done.stdout and "'time (s)': 0 to 0.798 s, increases" in done.stdout
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "two.yaml", "--yes", "--torque-scale", "mN m")
    line = next(x for x in (tmp_path / "two.yaml").read_text(encoding="utf-8").splitlines() if "torque: 0.001" in x)
    assert line.endswith("# mN m, as given")


def test_a_guess_is_marked_in_the_file(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(FILES["no_names.csv"][0], encoding="utf-8")
    made(tmp_path, "r.csv", "--yes")
    text = (tmp_path / "rig.yaml").read_text(encoding="utf-8")
    assert 'rate: "d"' in text and "# GUESS: it is the derivative of 'b'" in text
    assert "# GUESS: it is the only column left" in text


def test_on_a_terminal_only_what_is_not_clear_is_asked_and_a_wrong_answer_is_asked_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "r.csv").write_text("time (s),x1,rate (rad/s)\n" + rows(TIME, TORQUE / 35.15, RATE), encoding="utf-8")
    asked: list[str] = []
    answers = iter(["x7", "", "35.15"])

    def ask(question: str) -> str:
        asked.append(question)
        return next(answers)

    assert init([tmp_path / "r.csv"], InitOptions(out=tmp_path / "rig.yaml"), ask) == 0
    assert len(asked) == 3
    assert asked[0].startswith("Which column is the torque?") and asked[0].endswith("[x1] ")
    assert asked[2].startswith("Unit of 'x1', or factor to SI units?")
    assert "'x7' is no column of numbers: choose one of" in capsys.readouterr().err
    agrees(read_recording(load_config(tmp_path / "rig.yaml")).runs[0])
    with pytest.raises(UsageError, match="no answer that could be used in 3 tries"):
        init([tmp_path / "r.csv"], InitOptions(out=tmp_path / "two.yaml"), lambda question: "x7")


def test_what_is_written_passes_the_check_and_nothing_is_written_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "run 1.csv").write_text(FILES["drive_trace.csv"][0], encoding="utf-8")
    assert command(app, "init", "data/run 1.csv").exit_code == 0
    assert 'file: "data/run 1.csv"' in (tmp_path / "rig.yaml").read_text(encoding="utf-8")
    checked = command(app, "check", "rig.yaml")
    assert checked.exit_code == 0 and "400 samples of rate and angle" in checked.stdout
    again = command(app, "init", "data/run 1.csv")
    assert again.exit_code == 2
    assert "rig.yaml exists and is never overwritten: repeat the command with --out run_1.yaml, then" in again.stderr


def test_where_the_file_exists_a_free_name_and_what_follows_are_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("rig.yaml", "my_recording.yaml"):
        (tmp_path / name).write_text("kept", encoding="utf-8")
    (tmp_path / "my_recording.csv").write_text(GOOD, encoding="utf-8")
    refused = command(app, "init", "my_recording.csv")
    assert refused.exit_code == 2
    free = "my_recording_2.yaml"
    assert f"repeat the command with --out {free}, then identify-run {free}" in refused.stderr
    done = command(app, "init", "my_recording.csv", "--out", free)
    assert done.exit_code == 0 and f"{free}: written. Next: rig check {free}, then identify-run {free}" in done.stdout
    assert (tmp_path / "rig.yaml").read_text(encoding="utf-8") == "kept"


@pytest.mark.parametrize(
    ("source", "free"),
    [
        ("data/run 1;x.csv", "run_1_x"), ("run.csv.gz", "run"), ("bag", "bag"), ("--out.csv", "out"),
        ("*.csv", "recording"),
    ],
)  # fmt: skip
def test_the_name_proposed_needs_no_quotes(source: str, free: str, tmp_path: Path) -> None:
    assert free_name(tmp_path / "rig.yaml", [Path(source)]) == tmp_path / f"{free}.yaml"
    assert free_name(tmp_path / "rig.yaml", []) == tmp_path / "bench.yaml"


@pytest.mark.slow
def test_what_is_written_is_identified_as_it_stands(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(FILES["drive_trace.csv"][0], encoding="utf-8")
    made(tmp_path, "r.csv")
    done = command(identify_run, tmp_path / "rig.yaml", "--out", tmp_path / "out", "--set", "identify.candidates=[]")
    assert done.exit_code == 0, done.stderr
    found = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["before"]["parameters"]
    assert found["stiffness"]["value"] == pytest.approx(6.0, rel=0.01)


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        (GOOD, ["--rate", "w"], "--rate 'w' is no column of numbers"),
        (GOOD, ["--rate-scale", "kg"], "neither a number nor a known"),
        (GOOD, ["--rate-scale", "0"], "other than zero"),
        (GOOD, ["--angle-scale", "1"], "there is no column of the angle"),
        (GOOD, ["--axis", "round"], "give rotary or linear"),
        (GOOD, ["--rate", "none"], "no rate and no angle"),
        ("kk,torque_nm,rate_rad_s\n" + rows(TORQUE, TORQUE, RATE), ["--yes"], "--time COL"),
        ("time_s,torque_nm,rate_rad_s\n" + rows(TIME[::-1], TORQUE, RATE), ["--yes"], "time is not sorted"),
        (
            "time (s),torque (N m),rate (rad/s),angle (rad)\n" + rows(TIME, TORQUE, RATE, np.degrees(ANGLE)),
            [],
            "probably the angle is in degrees: set --angle-scale 0.0174533",
        ),
        ("name,text\na,b\nc,d\n", [], "fewer than two columns of numbers"),
        (rows(TIME, TORQUE, RATE), [], "add a first line that names the columns"),
        (
            "Time,Torque (Nm),Rate (rad/s)\n"
            + stamped("%d/%m/%Y %H:%M:%S.%f", rows(TORQUE, RATE), ",")
            .replace("01/05", "02/05")
            .replace("02/05", "01/05", 9),
            [],
            "write the date as 2024-12-31",
        ),
        (
            "t (s);M (Nm);w (rad/s)\n" + german(rows(TIME, 1e3 + TORQUE, RATE, by=";")).replace(";1000", ";1.000"),
            [],
            "no sign between thousands",
        ),
    ],
)
def test_what_cannot_be_used_is_refused_with_the_option(
    text: str, options: list[str], words: str, tmp_path: Path
) -> None:
    (tmp_path / "r.csv").write_text(text, encoding="utf-8")
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml", *options)
    assert done.exit_code == 2
    assert words in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["r.csv"]


def test_a_recording_of_this_program_needs_no_columns_and_takes_none(tmp_path: Path) -> None:
    run = Run("set 1", TIME, np.ones(len(TIME), bool), RATE, torque_time_s=TIME, torque_nm=TORQUE)
    write_recording_h5(tmp_path / "recording.h5", Recording((run,)))
    agrees(made(tmp_path, "recording.h5"))
    done = command(app, "init", tmp_path / "recording.h5", "--out", tmp_path / "two.yaml", "--torque-scale", "2")
    assert done.exit_code == 2 and "leave out --torque-scale" in done.stderr


def test_a_free_decay_needs_no_torque(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("t/s,angle/deg\n" + rows(TIME, np.degrees(ANGLE)), encoding="utf-8")
    run = made(tmp_path, "r.csv", "--torque", "none")
    assert run.torque_nm is None and run.angle_rad is not None


NO_TORQUE = {
    "no other column": ("t/s,angle/deg\n", [TIME, np.degrees(ANGLE)], "no torque was recognised"),
    "columns of another kind": (
        "t/s,angle/deg,sensor 1 [V],sensor 2 [V]\n",
        [TIME, np.degrees(ANGLE), TORQUE, RATE],
        "not used, but they move: 'sensor 1 [V]', 'sensor 2 [V]'",
    ),
    "zero": ("time_s,torque_nm,rate_rad_s\n", [TIME, 0 * TORQUE, RATE], "column 'torque_nm'"),
    "constant": ("t/s,torque [Nm],angle/deg\n", [TIME, 0 * TORQUE + 2, np.degrees(ANGLE)], "but is 2 throughout"),
}


@pytest.mark.parametrize("case", NO_TORQUE)
def test_without_a_torque_that_acts_somebody_has_to_say_that_it_is_a_free_decay(case: str, tmp_path: Path) -> None:
    header, columns, words = NO_TORQUE[case]
    (tmp_path / "r.csv").write_text(header + rows(*columns), encoding="utf-8")
    for options in ([], ["--yes"]):
        done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml", *options)
        assert done.exit_code == 2
        assert words in done.stderr and "or --torque none if the platform moved freely" in done.stderr
        assert not (tmp_path / "rig.yaml").exists()
    assert made(tmp_path, "r.csv", "--torque", "none").torque_nm is None
    assert "torque: none" in (tmp_path / "rig.yaml").read_text(encoding="utf-8")


def test_on_a_terminal_a_torque_that_was_not_recognised_is_asked_without_a_guess(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("t/s,angle/rad,u [V]\n" + rows(TIME, ANGLE, TORQUE / 2), encoding="utf-8")
    asked: list[str] = []
    answers = iter(["", "u [V]", "2"])

    def ask(question: str) -> str:
        asked.append(question)
        return next(answers)

    assert init([tmp_path / "r.csv"], InitOptions(out=tmp_path / "rig.yaml"), ask) == 0
    assert asked[0] == asked[1] and asked[0].endswith("; none: there is none) ")
    agrees(read_recording(load_config(tmp_path / "rig.yaml")).runs[0])


def test_the_time_cannot_be_none(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(GOOD, encoding="utf-8")
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml", "--time", "none")
    assert done.exit_code == 2 and "--time 'none' is no column of numbers" in done.stderr
    assert "or none" not in done.stderr
