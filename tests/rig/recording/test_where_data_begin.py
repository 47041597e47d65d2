"""Where the data of a text file begin, and which line above them names the columns, also where words stand in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commands.rig.app import app
from rig.recording.readers import read_file
from rig.recording.run import Run
from rig.recording.table import Table
from tests.commands.support import command
from tests.rig.recording.support import motion, read, refusal

M = motion(60)
T, TORQUE, RATE = M["time_s"], M["torque_nm"], M["rate_rad_s"]


def lines(form: str, by: str = "\n") -> str:
    """A line a sample; ``form`` has its time, torque, rate and number."""
    rows = zip(T.tolist(), TORQUE.tolist(), RATE.tolist(), range(len(T)), strict=True)
    return by.join(form.format(*row) for row in rows) + "\n"


PLAIN = "{0!r},{1!r},{2!r}"
STAMPED = '"2024-05-06 14:03:{0:06.3f}",{3},{1!r},{2!r}'
READ = {
    "a preamble and a column of words": "Logger 4711\nOperator: Meier\n\ntime [s],torque [Nm],rate [rad/s],state\n"
    + lines(PLAIN + ",RUN"),
    "words in the first column": "Logger 4711\nOperator,Meier\n\nstate,time [s],torque [Nm],rate [rad/s]\n"
    + lines("RUN," + PLAIN),
    "units below the names besides": "Exported by X\ntime;torque;rate;state\ns;Nm;rad/s;\n"
    + lines("{0!r};{1!r};{2!r};RUN"),
    "a preamble of labelled numbers": "Block,3000,3000,a\nSlope,1.0,1.0,b\nStart,0.0,0.0,c\nName of all\n"
    "state,time [s],torque [Nm],rate [rad/s]\n" + lines("RUN," + PLAIN),
    "a header behind the sign of a comment": "#time_s,torque_nm,rate_rad_s,state\n" + lines(PLAIN + ",RUN"),
    "whole numbers below such a header": "# torque (N m),rate (rad/s),time (ms),state\n0,2,0,RUN\n"
    + lines("{1!r},{2!r},{3},RUN").partition("\n")[2],
    "a comment with spaces before its units": "# time (s)   torque (N m)   rate (rad/s)\n"
    + lines("{0!r}  {1!r}  {2!r}"),
    "times of the robots' bus": "%time (s),field.seq,field.frame_id,torque (N m),rate (rad/s)\n"
    + lines("{0!r},{3},base,{1!r},{2!r}"),
    "a preamble as wide as the data": "Data1\tStart\t5/6/2024 2:03:07.000 PM\nSample rate\t1000 Hz\nChannels\t2\n\n"
    "time (s)\ttorque (N m)\trate (rad/s)\n" + lines("{0!r}\t{1!r}\t{2!r}"),
    "how it was made below the units": '"TOA5","CR6","CR6","12","a","b","99","Fast"\n'
    '"TIMESTAMP","RECORD","torque","rate"\n'
    '"TS","RN","N m","rad/s"\n"","","Smp","Smp"\n' + lines(STAMPED),
    "the same without a preamble": '"TIMESTAMP","RECORD","torque","rate"\n"TS","RN","N m","rad/s"\n"","","Avg","Max"\n'
    + lines(STAMPED),
}  # fmt: skip
STAMPS = "  columns: {time: TIMESTAMP}\n"


def agrees(run: Run) -> None:
    np.testing.assert_allclose(run.time_s - run.time_s[0], T, atol=1e-9)
    assert run.rate_rad_s is not None and run.torque_nm is not None
    np.testing.assert_allclose(run.rate_rad_s, RATE, rtol=1e-12)
    np.testing.assert_allclose(run.torque_nm, TORQUE, rtol=1e-12)


@pytest.mark.parametrize("case", READ)
def test_the_header_is_found_and_no_sample_is_lost(case: str, tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(READ[case], encoding="utf-8")
    agrees(read(tmp_path, "r.csv", STAMPS if "TIMESTAMP" in READ[case] else "").runs[0])


def test_data_with_words_and_without_a_header_are_refused_with_the_cure(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(lines(PLAIN + ",RUN"))
    assert "line 1 holds numbers where the header has to be: add a first line" in refusal(tmp_path, "r.csv")


@pytest.mark.parametrize(
    ("sign", "row"), [("\t", "{0!r}\t{1!r}\t{2!r}"), (" ", "{0!r} {1!r} {2!r}"), (";", "{0!r};{1!r};{2!r}")]
)
def test_the_cure_has_the_sign_that_the_numbers_have_between_them(sign: str, row: str, tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(lines(row))
    cure = sign.join(("time_s", "torque_nm", "rate_rad_s"))
    told = "time_s torque_nm rate_rad_s with a tab" if sign == "\t" else cure
    assert refusal(tmp_path, "r.csv").endswith(f"e.g. {told}")
    (tmp_path / "r.csv").write_text(f"{cure}\n" + lines(row))
    agrees(read(tmp_path, "r.csv").runs[0])


@pytest.mark.parametrize(
    ("header", "names"),
    [
        ("state,1,2,3", ("state", "1", "2", "3")),  # an oscilloscope's channels
        ("# exported by X\nstate,time,torque,rate", ("state", "time", "torque", "rate")),
    ],
)
def test_a_header_above_words_stays_one(header: str, names: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(f"{header}\n" + lines("RUN," + PLAIN))
    (table,) = read_file(tmp_path / "r.csv")
    assert isinstance(table, Table) and table.names == names
    assert len(table.read(names[1:])[names[1]]) == len(T)


def test_damaged_rows_below_a_header_are_still_told(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("time_s,torque_nm,rate_rad_s\n0,1\n1,err,err\n" + lines(PLAIN))
    assert "line 2 has 2 fields where the header names 3" in refusal(tmp_path, "r.csv")


def test_lines_with_words_behind_the_heading_of_a_recorder_are_no_rows(tmp_path: Path) -> None:
    head = (
        '"Model","DL850E"\n"TraceName","torque","rate"\n"VUnit","Nm","rad/s"\n"SampleRate",1000,1000\n'
        '"HOffset",0.0,0.0\n"HUnit","s","s"\n"Date","2024/05/06","2024/05/06"\n"Block",3000,3000\n"Time","14:03:07.00",""\n'
    )
    (tmp_path / "r.csv").write_text(head + "\n" + lines(",{1!r},{2!r}"))
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 0, done.stderr
    assert "'time_s': 0 to 0.059 s, increases" in done.stdout
