"""CSV as other programs write it: units, preambles, decimal commas, time stamps are read, or refused with the cure."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from rig.recording.readers import read_file
from rig.recording.readers.text.timestamps import Stamps
from rig.recording.run import Run
from rig.recording.table import Table
from tests.rig.recording.support import motion, read, refusal

M = motion(120)
T, TORQUE, RATE, ANGLE = M["time_s"], M["torque_nm"], M["rate_rad_s"], M["angle_rad"]


def rows(*columns: np.ndarray, delimiter: str = ",") -> str:
    return "".join(delimiter.join(repr(float(v)) for v in row) + "\n" for row in zip(*columns, strict=True))


def quoted(text: str) -> str:
    return "".join(",".join(f'"{field}"' for field in line.split(";")) + "\n" for line in text.splitlines())


def comma(text: str) -> str:
    return text.replace(".", ",")


def as_read(folder: Path, text: str, options: str = "", file: str = "r.csv", encoding: str = "utf-8") -> Run:
    (folder / file).write_bytes(text.encode(encoding))
    return read(folder, file, options).runs[0]


def agrees(run: Run) -> None:
    np.testing.assert_allclose(run.time_s, T, atol=1e-12)
    assert run.rate_rad_s is not None and run.torque_nm is not None
    np.testing.assert_allclose(run.rate_rad_s, RATE, rtol=1e-12)
    np.testing.assert_allclose(run.torque_nm, TORQUE, rtol=1e-12)


DEGREES = rows(1e3 * T, 1e3 * TORQUE, np.degrees(RATE))
SI = rows(T, TORQUE, RATE)
WRITTEN = {
    "units in brackets": "time (ms),torque [mN m],rate (deg/s)\n" + DEGREES,
    "units behind a slash": "t/ms,torque/mNm,rate/(deg/s)\n" + DEGREES,
    "a row of units": "time,torque,rate\nms,mN m,deg/s\n" + DEGREES,
    "a row of units in brackets": "Time,Torque,Rate\n(ms),(mN·m),(°/s)\n\n" + DEGREES,
    "a row of units below default names": "time_s,torque_nm,rate_deg_s\ns,N m,deg/s\n"
    + rows(T, TORQUE, np.degrees(RATE)),
    "a row of units without one for all": "time_s,torque_nm,rate_rad_s,note\ns,,-,\n" + rows(T, TORQUE, RATE, RATE),
    "a row of units and a column of text": "time,torque,rate,state\nms,mN m,deg/s,\n" + DEGREES.replace("\n", ",OK\n"),
    "a preamble": "Recorder,X1\nDate,2024-05-01\nSample rate,1000\n\ntime,torque,rate\ns,N m,rad/s\n" + SI,
    "a preamble without units": "Project: bench 3\nOperator: Smith\n\ntime_s,torque_nm,rate_rad_s\n" + SI,
    "a spreadsheet's separator": "sep=;\ntime_s;torque_nm;rate_rad_s\n" + SI.replace(",", ";"),
    "decimal commas": "time_s;torque_nm;rate_rad_s\n" + comma(rows(T, TORQUE, RATE, delimiter=";")),
    "decimal commas after whole numbers": "time_s;torque_nm;rate_rad_s\n0;0;2\n"
    + comma(rows(T[1:], TORQUE[1:], RATE[1:], delimiter=";")),
    "decimal commas beside a date with points": "Datum;time_s;torque_nm;rate_rad_s\n"
    + "".join(f"06.05.2024;{line}\n" for line in comma(rows(T, TORQUE, RATE, delimiter=";")).splitlines()),
    "decimal commas beside words with points": "time_s;torque_nm;rate_rad_s;state;rig\n"
    + "".join(f"{line};i.O.;Nr. 4\n" for line in comma(rows(T, TORQUE, RATE, delimiter=";")).splitlines()),
    "exponents of Fortran": "time_s,torque_nm,rate_rad_s\n"
    + "".join(f"{t:.16E},{m:.16E},{w:.16e}\n" for t, m, w in zip(T, TORQUE, RATE, strict=True))
    .replace("E", "D").replace("e", "d"),
    "decimal commas in quotes": "time_s,torque_nm,rate_rad_s\n" + quoted(comma(rows(T, TORQUE, RATE, delimiter=";"))),
    "decimal commas and tabs": "time_s\ttorque_nm\trate_rad_s\n" + comma(rows(T, TORQUE, RATE, delimiter="\t")),
    "bars": "time_s|torque_nm|rate_rad_s\n" + rows(T, TORQUE, RATE, delimiter="|"),
    "a minus sign of its own": "time_s;torque_nm;rate_rad_s\n"
    + rows(T, TORQUE, RATE, delimiter=";").replace("-", "\N{MINUS SIGN}").replace("e\N{MINUS SIGN}", "e-"),
    "a header that is repeated": "time_s,torque_nm,rate_rad_s\n"
    + rows(T[:60], TORQUE[:60], RATE[:60]) + "time_s,torque_nm,rate_rad_s\n" + rows(T[60:], TORQUE[60:], RATE[60:]),
    "spaces between thousands": "time (us);torque (N m);rate (rad/s)\n"
    + "".join(f"{1e6 * t:,.1f};{m!r};{w!r}\n".replace(",", "\N{NARROW NO-BREAK SPACE}")
              for t, m, w in zip(T.tolist(), TORQUE.tolist(), RATE.tolist(), strict=True)),
    "spaces in units between spaces": "time (s)   torque (N m)   rate (rad/s)\n"
    + rows(T, TORQUE, RATE, delimiter="   "),
}  # fmt: skip


@pytest.mark.parametrize("case", WRITTEN)
def test_it_is_read_in_si_units(case: str, tmp_path: Path) -> None:
    agrees(as_read(tmp_path, WRITTEN[case]))


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8", "utf-16", "utf-16-le", "utf-16-be"])
def test_a_degree_sign_is_one_in_every_encoding(encoding: str, tmp_path: Path) -> None:
    agrees(as_read(tmp_path, "time (ms),torque (mN·m),rate (°/s)\n" + DEGREES, encoding=encoding))


def test_a_labview_file_is_read_below_its_header(tmp_path: Path) -> None:
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
        "***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t120\t120\t\nDate\t2024/05/01\t2024/05/01\t\n"
        "X0\t0.0\t0.0\t\nDelta_X\t0.001\t0.001\t\n***End_of_Header***\t\t\t\n"
    )
    text = f"{head}time_s\ttorque_nm\trate_rad_s\tComment\n{rows(T, TORQUE, RATE, delimiter=chr(9))}"
    agrees(as_read(tmp_path, text, file="run.lvm"))


def test_a_mapped_name_is_found_without_its_unit_and_a_given_scale_stands(tmp_path: Path) -> None:
    text = "T (ms),M (A),W (deg/s)\n" + rows(1e3 * T, TORQUE / 2.0, np.degrees(RATE))
    agrees(as_read(tmp_path, text, "  columns: {time: T, torque: M, rate: W}\n  scale: {torque: 2.0}\n"))
    agrees(
        as_read(tmp_path, text, '  columns: {time: T, torque: "M (A)", rate: "W (deg/s)"}\n  scale: {torque: 2.0}\n')
    )


def test_a_linear_axis_has_units_of_its_own(tmp_path: Path) -> None:
    text = "time (s),force (kN),speed (mm/s)\n" + rows(T, 1e-3 * TORQUE, 1e3 * RATE)
    agrees(as_read(tmp_path, text, "  axis: linear\n"))
    (tmp_path / "r.csv").write_text(text)
    assert "'kN', a unit of force and not of torque: set recorded.axis: linear" in refusal(tmp_path, "r.csv")


REFUSED = {
    "time (s),torque (V),rate (rad/s)": "is in 'V', a unit of voltage and not of torque: set recorded.scale.torque",
    "time (s),torque (N m),rate (furlong)": "is in 'furlong', a unit that is not known: set recorded.scale.rate",
    "time_s,torque_nm,rate_rad_s (deg/s)": "has no column",
    "time_s,torque_nm,rate_rad_s\ns,N m,deg/s": "one unit in its name and another, 'deg/s', stated with it",
    "Head,1\nRow 2,3": "no line above names their 3 columns: add one",
}  # fmt: skip


@pytest.mark.parametrize("head", REFUSED)
def test_what_cannot_be_converted_is_refused_with_the_cure(head: str, tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(f"{head}\n{SI}")
    assert REFUSED[head] in refusal(tmp_path, "r.csv")


def test_decimal_commas_between_commas_and_thousands_are_refused_with_the_cure(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("time_s,torque_nm,rate_rad_s\n" + comma(SI))
    assert "separate the columns by semicolons" in refusal(tmp_path, "r.csv")
    for at in (3, 70):  # among the lines by which the decimal sign is known, and behind them
        lines = comma(rows(T, TORQUE, RATE, delimiter=";")).splitlines()
        lines[at] = "0,001;1.234;2,0"
        (tmp_path / "r.csv").write_text("time_s;torque_nm;rate_rad_s\n" + "\n".join(lines) + "\n")
        assert "use one decimal sign in the whole file" in refusal(tmp_path, "r.csv")


@pytest.mark.parametrize("signs", [(",", "."), (".", ",")])
def test_signs_between_thousands_are_read_where_a_decimal_sign_stands_behind_them(
    signs: tuple[str, str], tmp_path: Path
) -> None:
    between, decimal = signs

    def written(value: float) -> str:
        return f"{value:,.9f}".translate(str.maketrans({",": between, ".": decimal}))

    columns = (1e3 * T, 1e3 * TORQUE, RATE)
    body = "".join(";".join(f'"{written(float(v))}"' for v in row) + "\n" for row in zip(*columns, strict=True))
    run = as_read(tmp_path, "time (ms);torque (mN m);rate (rad/s)\n" + body)
    assert run.torque_nm is not None
    np.testing.assert_allclose(run.torque_nm, TORQUE, atol=1e-9)


def test_a_factor_that_is_advised_takes_the_place_of_the_one_that_was_applied(tmp_path: Path) -> None:
    text = "time (s),torque (N m),rate (deg/s),angle (rad)\n" + rows(T, TORQUE, -np.degrees(RATE), ANGLE)
    (tmp_path / "r.csv").write_text(text)
    message = refusal(tmp_path, "r.csv")
    assert "opposite signs: set recorded.scale.rate: -0.0174533 or recorded.scale.angle: -1" in message
    agrees(read(tmp_path, "r.csv", "  scale: {rate: -0.0174532925199433}\n").runs[0])
    assert "recorded.scale.rate: -0.017455" in refusal(tmp_path, "r.csv", "  scale: {rate: 0.5}\n")


@pytest.mark.parametrize(
    "stamp",
    [
        "%Y-%m-%d %H:%M:%S.%f",
        "%Y-%m-%dT%H:%M:%S.%f+02:00",
        "%d.%m.%Y %H:%M:%S,%f",
        "%Y/%m/%d %H:%M:%S.%f",
        "%H:%M:%S.%f",
        "%m/%d/%Y %H:%M:%S.%f",
        "%d/%m/%Y %H:%M:%S.%f",
        "%m/%d/%Y %I:%M:%S.%f %p",
        "%Y-%m-%d %I:%M:%S.%f %p",
        "%I:%M:%S.%f %p",
        "%Y%m%dT%H%M%S.%f",
        "%d-%b-%Y %H:%M:%S.%f",
    ],
)
def test_time_stamps_are_seconds(stamp: str, tmp_path: Path) -> None:
    start = datetime(2024, 12, 31, 23, 59, 59, 950_000)  # passes midnight
    stamps = [(start + timedelta(seconds=float(t))).strftime(stamp) for t in T]
    numbers = rows(TORQUE, RATE, delimiter=";").splitlines()
    numbers = [comma(line) for line in numbers] if ",%f" in stamp else numbers
    lines = "".join(f"{s};{line}\n" for s, line in zip(stamps, numbers, strict=True))
    run = as_read(tmp_path, f"time_s;torque_nm;rate_rad_s\n{lines}")
    np.testing.assert_allclose(run.time_s - run.time_s[0], T, atol=1e-9)
    assert run.time_s[0] == pytest.approx(86_399.95)


def test_a_date_that_may_be_two_is_refused_with_the_cure(tmp_path: Path) -> None:
    days = "05/06/2024 23:59:59.9,1,2\n06/06/2024 00:00:00.0,1,2\n"
    (tmp_path / "r.csv").write_text("time_s,torque_nm,rate_rad_s\n" + days)
    assert "write the date as 2024-12-31 or 31.12.2024" in refusal(tmp_path, "r.csv")
    with pytest.raises(ValueError, match="yesterday"):
        Stamps().seconds("yesterday")


@pytest.mark.parametrize(
    ("days", "form"),
    [(("05/06/2024", "05/07/2024"), "%I:%M:%S.%f %p"), (("05/06/2024", "06/06/2024"), "%H:%M:%S.%f")],
)
def test_a_clock_that_goes_on_over_midnight_says_what_is_the_day(
    days: tuple[str, str], form: str, tmp_path: Path
) -> None:
    start = datetime(2024, 1, 1, 23, 59, 59, 950_000)
    times = [start + timedelta(seconds=float(t)) for t in T]
    lines = [f"{days[time.day - 1]} {time.strftime(form)}" for time in times]
    body = "".join(f"{s},{line}\n" for s, line in zip(lines, rows(TORQUE, RATE).splitlines(), strict=True))
    run = as_read(tmp_path, "time_s,torque_nm,rate_rad_s\n" + body)
    np.testing.assert_allclose(run.time_s - run.time_s[0], T, atol=1e-9)


@pytest.mark.parametrize(
    ("first", "later", "seconds"),
    [
        ("05/06/2024 12:00:00.5", "05/06/2024 12:00:01.5", 1.0),  # whichever is the day
        ("05/12/2024 23:59:59.5", "05/13/2024 00:00:00.5", 1.0),
        ("11/28/2026 11:59:59.5 AM", "11/28/2026 12:00:00.5 PM", 1.0),
        ("12:59:59.5 AM", "01:00:00.5 AM", 1.0),
        ("11:59:59.5 p.m.", "12:00:00.5 a.m.", 1.0),
        ("15:49:01:123", "15:49:02:125", 1.002),
        ("59:59.25", "00:00.5", 0.25 + 1.0),
        ("100:00:00.5", "100:00:01.5", 1.0),
        ("0 days 00:00:00.000000", "1 days 00:00:01.500000", 86_401.5),
        ("2024-10-27 02:59:59+02:00", "2024-10-27T02:00:00+01:00", 1.0),
        ("12:00:00.000000001", "12:00:00.000000251", 2.5e-7),
    ],
)
def test_stamps_of_many_kinds_are_seconds(first: str, later: str, seconds: float) -> None:
    stamps = Stamps()
    assert -stamps.seconds(first) + stamps.seconds(later) == pytest.approx(seconds, abs=1e-11)


@pytest.mark.parametrize(
    "text",
    [
        "13/13/2024 12:00",
        "13:00 PM",
        "2024-02-30 12:00",
        "a:b",
        "12:61",
        "2024-01-01 25:00:00",
        "1.2.3 10:00",
        "5:6:7:8:9",
    ],
)
def test_what_is_no_stamp_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        Stamps().seconds(text)


@pytest.mark.parametrize(
    ("field", "words"),
    [
        ("2026:332:15:49:01.123", "a form that is not known: write it as 2024-12-31 23:59:59.123"),
        ("2026-11-28", "a date without a time of day"),
        ("0.5 Nm", "a number with a unit"),
        ("OK", "leave it empty and add a column valid"),
    ],
)
def test_a_field_that_is_no_number_is_called_what_it_is(field: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(f"time_s,torque_nm,rate_rad_s\n0,{field},2\n1,{field},3\n")
    message = refusal(tmp_path, "r.csv")
    assert f"line 2, column 'torque_nm': '{field}' is" in message and words in message
    assert "row of units" not in message


@pytest.mark.parametrize(("yes", "no"), [("TRUE", "FALSE"), ("True", "False"), ("true", "false")])
def test_valid_may_be_said_in_words(yes: str, no: str, tmp_path: Path) -> None:
    lines = [f"{line},{no if i == 7 else yes}" for i, line in enumerate(rows(T, TORQUE, RATE).splitlines())]
    run = as_read(tmp_path, "time_s,torque_nm,rate_rad_s,valid\n" + "\n".join(lines) + "\n")
    assert (~run.valid).nonzero()[0].tolist() == [7]


def test_the_units_below_the_names_go_with_the_table(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("t,M,note\n(s),[N m],-\n0,1,2\n1,2,3\n")
    table = read_file(tmp_path / "r.csv")[0]
    assert isinstance(table, Table)
    assert table.units == {"t": "s", "M": "N m"}
    np.testing.assert_array_equal(table.read(["M"])["M"], [1.0, 2.0])
