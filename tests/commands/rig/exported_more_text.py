"""Text files of one platform's motion as measuring systems, PLCs and scripts of other makers export them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta

import numpy as np

from tests.commands.rig.exported_text import ANGLE, LVM, RATE, STAMPS, TIME, TORQUE, german, rows, stamped

DEG_S, MS = np.degrees(RATE), 1e3 * TIME


def each_line(text: str, form: str) -> str:
    """Every line put into ``form``, which has a place for it."""
    return "".join(form.format(line) + "\n" for line in text.splitlines())


def twincat(separator: str = "\t", decimal: str = ",") -> str:
    """TwinCAT's scope: a time in ms beside each channel, its properties above it."""
    names = (("MAIN.fbAxis.fActTorque", "Nm (Torque)"), ("MAIN.fbAxis.fGyroRate", "°/s (Angular velocity)"))
    said = [
        ("Name", [n for n, _ in names]),
        ("SymbolComment", ["", ""]),
        ("Data-Type", ["REAL64", "REAL64"]),
        ("SampleTime[ms]", ["2", "2"]),
        ("VariableSize", ["8", "8"]),
        ("SymbolName", [n for n, _ in names]),
        ("NetID", ["192.168.178.20.1.1"] * 2),
        ("Port", ["851", "851"]),
        ("Offset", ["0", "0"]),
        ("ScaleFactor", ["1", "1"]),
        ("BitMask", ["0xffffffffffffffff"] * 2),
        ("Unit", [u for _, u in names]),
        ("Unit ScaleFactor", ["1", "1"]),
        ("Unit Offset", ["0", "0"]),
    ]
    head = "Name\tScope YT\nFile\tC:\\scope\\run1.csv\n"
    head += "Starttime of export\t133590384000000000\tMittwoch, 1. Mai 2024\t12:00:00.000\n"
    head += "Endtime of export\t133590384008000000\tMittwoch, 1. Mai 2024\t12:00:00.800\n\n\n"
    head += "".join("\t".join(f"{key}\t{value}" for value in values) + "\n" for key, values in said)
    body = rows(MS, TORQUE, MS, DEG_S, by="\t")
    return (head + "\n" + body.replace(".", decimal)).replace("\t", separator)


def of_two_rates(text: str, decimal: str = ".") -> str:
    """The file with a second channel that is sampled twice as fast as the first, which ends earlier."""
    at = text.rindex("\n", 0, text.index("\n0\t0\t0\t0\n") + 1) + 1
    fine = np.arange(2 * len(TIME) - 1) / 2.0
    unit = MS[1] if decimal == "," else TIME[1]
    torque = [f"{unit * i:.9g}\t{v:.12g}" for i, v in enumerate(TORQUE)] + ["\t"] * (len(TIME) - 1)
    rate = [f"{unit * i:.9g}\t{v:.12g}" for i, v in zip(fine, np.interp(fine, np.arange(400.0), DEG_S), strict=True)]
    body = "".join(f"{a}\t{b}\n" for a, b in zip(torque, rate, strict=True))
    return text[:at] + body.replace(".", decimal)


def lvm_head(x_columns: str, multi: str = "No", decimal: str = ".") -> str:
    text = LVM.replace("X_Columns\tOne", f"X_Columns\t{x_columns}").replace(
        "Multi_Headings\tNo", f"Multi_Headings\t{multi}"
    )
    return text.replace("Decimal_Separator\t.", f"Decimal_Separator\t{decimal}")


def segments(each: int, anew: bool = False) -> str:
    """LabVIEW's file with a heading for every piece: each begins at an X0 of its own, or ``anew`` at 0 of its date."""
    head, _, special = lvm_head("One", "Yes").partition("\n\t\n")
    out = head + "\n\t\n"
    for first in range(0, len(TIME), each):
        part = slice(first, first + each)
        begin = 0.0 if anew else TIME[first]
        here = special.replace("400\t400", f"{each}\t{each}").replace("X0\t0\t0", f"X0\t{begin:g}\t{begin:g}")
        if anew:
            stamp = f"12:00:{TIME[first]:013.10f}"
            here = here.replace("Y_Unit_Label", f"Time\t{stamp}\t{stamp}\t\nY_Unit_Label")
        out += here + "X_Value\tTorque (N m)\tGyro (deg/s)\tComment\n"
        out += rows(TIME[part] - TIME[first] + begin, TORQUE[part], DEG_S[part], by="\t") + "\n"
    return out


def control_desk() -> str:
    """dSPACE's ControlDesk: a word in the first column says what the line is."""
    head = "format version,2.0\ncapture information\ncapture name,Capture_1\ndate,2024-05-01\ntime,12:00:00\n\n"
    head += "capture id,1\ntrace_names,time,torque_act,gyro_rate\npath,,Model Root/Drive,Model Root/Gyro\n"
    head += "description,,,\nunit,s,Nm,deg/s\ndata type,float64,float64,float64\n"
    lines = rows(TIME, TORQUE, DEG_S).splitlines()
    return head + f"trace_values,{lines[0]}\n" + "".join(f",{line}\n" for line in lines[1:])


def yokogawa() -> str:
    return (
        '//YOKOGAWA ASCII FILE FORMAT\nHeaderSize,16\nModel Name,"DL850E"\nComment,""\nBlockNumber,1\n'
        'TraceName,"Torque","Gyro"\nBlockSize,400,400\nVUnit,"Nm","deg/s"\nSampleRate,5.00E+02,5.00E+02\n'
        'HUnit,"s","s"\nDisplayBlockSize,400,400\nDisplayPointNo,1,1\nDate,2024/05/01,2024/05/01\n'
        "Time,12:00:00.0,12:00:00.0\nHOffset,0,0\n\n" + each_line(rows(TORQUE, DEG_S), ",{}")
    )


def rigol() -> str:
    lines = rows(np.arange(400.0), TORQUE, DEG_S).splitlines()
    return "X,Torque(N*m),Gyro(deg/s),Start,Increment\nSequence,N*m,deg/s,-4.00e-01,2.0e-03\n" + "".join(
        line + ",,\n" for line in lines
    )


def catman() -> str:
    head = "HBM_CATMAN_DATAFILE\t5.4\nZeit  1 - Standardmessrate\tMX840_0_Drehmoment\tMX840_0_Drehwinkel\n"
    return head + "s\tNm\t°\n" + german(rows(TIME, TORQUE, np.degrees(ANGLE), by="\t"))


def dewesoft() -> str:
    head = "Data file information\nFile name: run1.dxd\nStart time: 01.05.2024 12:00:00.000\nSample rate: 500 Hz\n"
    head += "Number of channels: 2\nStore type: always fast\n\n"
    return head + "Time\tTorque\tGyro\n(s)\t(Nm)\t(deg/s)\n" + rows(TIME, TORQUE, DEG_S, by="\t")


def etas() -> str:
    head = "ETASAsciiItemFile\trecord\tCrLf\tTab\nsampleCount 400\ntime\tTrqAct\tGyroRate\nf8\tf8\tf8\ns\tNm\tdeg/s\n"
    return head + rows(TIME, TORQUE, DEG_S, by="\t")


def xsens() -> str:
    head = "// Start Time: Unknown\n// Update Rate: 500.0Hz\n// Firmware Version: 1.10\n"
    head += "PacketCounter,SampleTimeFine,Gyr_X,Gyr_Y,Gyr_Z,Torque_Nm\n"
    zero = np.zeros(400)
    return head + rows(np.arange(400.0), 20.0 * np.arange(400) + 12.0, zero, zero, RATE, TORQUE)


def plotjuggler() -> str:
    names = "__time,/joint_states/axis1/effort,/joint_states/axis1/velocity\n"
    return names + "".join(
        f"{1714564800 + t:.9f},{a:.12g},{b:.12g}\n" for t, a, b in zip(TIME, TORQUE, RATE, strict=True)
    )


def names_only_once_a_second() -> str:
    """A logger whose clock shows whole seconds only."""
    begin = datetime(2024, 5, 1, 12, 0, 0)
    lines = zip(TIME, TORQUE, RATE, strict=True)
    return "Date,Torque [Nm],Rate [rad/s]\n" + "".join(
        f"{begin + timedelta(seconds=int(10 * t))},{a:.9g},{b:.9g}\n" for t, a, b in lines
    )


def mixed_stamps() -> str:
    """A day that is left out from the second row on, and fractions left out where they are zero."""
    first, *rest = stamped("%Y-%m-%d %H:%M:%S.%f", rows(TORQUE, RATE, by=";"), ";").splitlines()
    return (
        "Zeitstempel;Moment [Nm];Rate [rad/s]\n"
        + "\n".join([first.replace(".000000", "")] + [line.rstrip() for line in rest])
        + "\n"
    )


MULTI_X = (
    lvm_head("Multi")
    + "X_Value\tTorque (N m)\tX_Value\tGyro (deg/s)\tComment\n"
    + rows(TIME, TORQUE, TIME, DEG_S, by="\t")
)
FILES: dict[str, tuple[str, Sequence[str]]] = {
    "twincat.csv": (twincat(), ()),
    "twincat_semicolon.csv": (twincat(";"), ()),
    "multi_x.lvm": (MULTI_X, ()),
    "multi_rates.lvm": (of_two_rates(MULTI_X), ()),
    "twincat_rates.csv": (of_two_rates(twincat(), ","), ()),
    "segments.lvm": (segments(100), ()),
    "segments_anew.lvm": (segments(50, anew=True), ()),
    "no_x.lvm": (lvm_head("No") + "\tTorque\tGyro\tComment\n" + each_line(rows(TORQUE, DEG_S, by="\t"), "\t{}"), ()),
    "german.lvm": (
        lvm_head("One", decimal=",")
        + "X_Value\tMoment (Nm)\tDrehrate (°/s)\tComment\n"
        + german(rows(TIME, TORQUE, DEG_S, by="\t")),
        (),
    ),
    "controldesk.csv": (control_desk(), ()),
    "yokogawa.csv": (yokogawa(), ()),
    "rigol.csv": (rigol(), ()),
    "catman.asc": (catman(), ()),
    "dewesoft.txt": (dewesoft(), ()),
    "inca.asc": (etas(), ()),
    "xsens.csv": (xsens(), ("--time-scale", "0.0001", "--yes")),
    "plotjuggler.csv": (plotjuggler(), ("--yes",)),
    "timetable.csv": (
        "Time,Torque_Nm,Rate_deg_s\n"
        + "".join(f"{t:.3f} sec,{a:.12g},{b:.12g}\n" for t, a, b in zip(TIME, TORQUE, DEG_S, strict=True)),
        (),
    ),
    "timetable_hms.csv": (
        "Time,Torque_Nm,Rate_deg_s\n"
        + "".join(f"00:00:{t:06.3f},{a:.12g},{b:.12g}\n" for t, a, b in zip(TIME, TORQUE, DEG_S, strict=True)),
        (),
    ),
    "epoch_ms.csv": (
        "ts,torque_mNm,gyro_dps\n"
        + "".join(
            f"{1714564800000 + 2 * i},{1e3 * a:.9g},{b:.9g}\n"
            for i, (a, b) in enumerate(zip(TORQUE, DEG_S, strict=True))
        ),
        (),
    ),
    "trailing.csv": (
        each_line("Zeit [s];Moment [Nm];Rate [°/s]\n" + german(rows(TIME, TORQUE, DEG_S, by=";")), "{};"),
        (),
    ),
    "percent.csv": ("% exported\n% time (s), torque (N m), rate (rad/s)\n" + rows(TIME, TORQUE, RATE, by="  "), ()),
    "thousands.csv": (
        "Time (s),Torque (N mm),Rate (deg/s)\n"
        + "".join(f'{t:.3f},"{1e3 * a:,.6f}",{b:.9g}\n' for t, a, b in zip(TIME, TORQUE, DEG_S, strict=True)),
        (),
    ),
    "german_thousands.csv": (
        "Zeit (s);Moment (N mm);Rate (°/s)\n"
        + "".join(
            f"{german(f'{t:.3f}')};{f'{1e3 * a:,.6f}'.translate(str.maketrans(',.', '.,'))};{german(f'{b:.9g}')}\n"
            for t, a, b in zip(TIME, TORQUE, DEG_S, strict=True)
        ),
        (),
    ),
    "whole_seconds.csv": (names_only_once_a_second(), ("--sample-rate", "500")),
    "mixed.csv": (mixed_stamps(), ()),
    "siemens_trace.csv": (
        "Sample;Zeit [ms];r0080 Drehmoment-Istwert [Nm];r0063 Drehzahl-Istwert [1/min]\n"
        + german(rows(np.arange(400.0), MS, TORQUE, RATE * 30 / np.pi, by=";")),
        (),
    ),
    "clock.csv": (
        "Time [hh:mm:ss.fff];Torque [Nm];Rate [deg/s]\n" + stamped("%H:%M:%S.%f", rows(TORQUE, DEG_S, by=";"), ";"),
        (),
    ),
    "unit_behind_a_space.csv": ("Time s,Torque Nm,Speed krpm\n" + rows(TIME, TORQUE, RATE * 0.03 / np.pi), ()),
    "description_row.csv": (
        "Time,Trq,Gyro\nsystem time,motor shaft torque,z axis\ns,N·m,deg/s\n" + rows(TIME, TORQUE, DEG_S),
        (),
    ),
    "odrive.csv": (
        "time;axis0.controller.effective_torque_setpoint;axis0.motor.torque_estimate;axis0.vel_estimate [turns/s]\n"
        + rows(TIME, TORQUE + 0.02, TORQUE, RATE / (2 * np.pi), by=";"),
        ("--yes",),
    ),
    "canape.csv": (
        "sep=;\ntime;MotTrq\\XCP:1;GyroZ\\XCP:1\ns;Nm;deg/s\n" + german(rows(TIME, TORQUE, DEG_S, by=";")),
        (),
    ),
    "keysight_volts.csv": (
        "x-axis,1,2\nsecond,Volt,Volt\n" + rows(TIME, TORQUE / 2, RATE / 3, form="{:+.9E}"),
        ("--torque", "1", "--torque-scale", "2", "--rate", "2", "--rate-scale", "3"),
    ),
    "influx.csv": (
        "#group,false,false,true\n#datatype,string,long,dateTime:RFC3339\n#default,_result,,\n"
        + ",result,table,_time,torque_Nm,gyro_deg_s\n"
        + "".join(
            f",_result,0,{s.strftime('%Y-%m-%dT%H:%M:%S.%f')}Z,{a:.9g},{b:.9g}\n"
            for s, a, b in zip(STAMPS, TORQUE, DEG_S, strict=True)
        ),
        (),
    ),
}
