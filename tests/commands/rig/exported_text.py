"""The motion of one platform, and text files of it as other tools export them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta

import numpy as np

from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform

TIME = np.arange(400) * 2e-3
TORQUE = 2.0 * np.sin(11.0 * TIME) + 0.7 * np.sin(31.0 * TIME)
MOTION = simulate(Platform(0.02, 0.05, 6.0), TIME, TorqueSignal(TIME, TORQUE))
RATE, ANGLE = MOTION.rate_rad_s, MOTION.angle_rad
STAMPS = [datetime(2024, 5, 1, 12, 0, 0) + timedelta(seconds=float(t)) for t in TIME]
Columns = Sequence[np.ndarray]


def rows(*columns: np.ndarray, by: str = ",", form: str = "{:.12g}") -> str:
    return "".join(by.join(form.format(v) for v in row) + "\n" for row in zip(*columns, strict=True))


def german(text: str) -> str:
    return text.replace(".", ",")


def stamped(form: str, numbers: str, by: str) -> str:
    return "".join(f"{s.strftime(form)}{by}{line}\n" for s, line in zip(STAMPS, numbers.splitlines(), strict=True))


LVM = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\nOperator\tlab\nDate\t2024/05/01\nTime\t12:00:00.0\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nSamples\t400\t400\t\nDate\t2024/05/01\t2024/05/01\t\nY_Unit_Label\tN m\tdeg/s\t\nX0\t0\t0\t\n"
    "Delta_X\t0.002\t0.002\t\n***End_of_Header***\t\t\t\n"
)
# File name -> text and further options; all are read at the first try, without a terminal.
FILES: dict[str, tuple[str, tuple[str, ...]]] = {
    "labview.lvm": (
        LVM + "X_Value\tMotor torque (N m)\tGyro (deg/s)\tComment\n" + rows(TIME, TORQUE, np.degrees(RATE), by="\t"),
        (),
    ),
    "labview_units.lvm": (LVM + "X_Value\tM\tGyro\tComment\n" + rows(TIME, TORQUE, np.degrees(RATE), by="\t"), ()),
    "scope_units.csv": (
        "Model,MSO44\n\nHorizontal Units,mS,\nSample Interval,2,\nVertical Units,mN m,°/s\nLabel,a,b\nTIME,CH1,CH2\n"
        + rows(1e3 * TIME, 1e3 * TORQUE, np.degrees(RATE), form="{:.9e}"),
        (),
    ),
    "labview_text.txt": ("Time (s)\tTorque (N·m)\tAngle (°)\n" + rows(TIME, TORQUE, np.degrees(ANGLE), by="\t"), ()),
    "matlab_writetable.csv": ("t,M,w,phi\n" + rows(TIME, TORQUE, RATE, ANGLE), ("--yes",)),
    "oscilloscope.csv": (
        "Model,MSO-X 3024\nSerial,MY1234\nSample interval,2.0E-3,s\n\nTime,Torque,Rate\nsecond,N·m,deg/s\n"
        + rows(TIME, TORQUE, np.degrees(RATE), form="{:+.9E}"),
        (),
    ),
    "picoscope.csv": ("Time,Torque,Position\n(ms),(mN m),(mrad)\n\n" + rows(1e3 * TIME, 1e3 * TORQUE, 1e3 * ANGLE), ()),
    "logger_german.csv": (
        "Zeit [ms];Drehmoment [Nm];Drehzahl [1/min]\n" + german(rows(1e3 * TIME, TORQUE, RATE * 30 / np.pi, by=";")),
        (),
    ),
    "spreadsheet.csv": (
        "sep=;\nZeit/s;Motormoment/Nm;Winkel/°\n" + german(rows(TIME, TORQUE, np.degrees(ANGLE), by=";")),
        (),
    ),
    "stamps.csv": (
        "Timestamp;Drehmoment [Nm];Winkelgeschwindigkeit [°/s]\n"
        + stamped("%d.%m.%Y %H:%M:%S,%f", german(rows(TORQUE, np.degrees(RATE), by=";")), ";"),
        (),
    ),
    "iso.csv": (
        "timestamp,torque_mNm,rate_dps\n" + stamped("%Y-%m-%dT%H:%M:%S.%f", rows(1e3 * TORQUE, np.degrees(RATE)), ","),
        (),
    ),
    "drive_trace.csv": (
        "time_us,torque_cmd_Nm,torque_actual_Nm,velocity_rpm,position_deg\n"
        + rows(1e6 * TIME, TORQUE + 0.01, TORQUE, RATE * 30 / np.pi, np.degrees(ANGLE)),
        (),
    ),
    "pandas.csv": (",time_s,torque_nm,rate_rad_s\n" + rows(np.arange(400.0), TIME, TORQUE, RATE), ()),
    "numpy_savetxt.csv": ("# time_s,torque_nm,angle_deg\n" + rows(TIME, TORQUE, np.degrees(ANGLE), form="{:.18e}"), ()),
    "current.csv": (
        "time (s),current (A),speed (rpm)\n" + rows(TIME, TORQUE / 0.5, RATE * 30 / np.pi),
        ("--torque-scale", "0.5"),
    ),
    "counter.csv": (
        "sample,torque_nm,rate_deg_s\n" + rows(np.arange(400.0), TORQUE, np.degrees(RATE)),
        ("--time-scale", "0.002"),
    ),
    "no_names.csv": ("a,b,c,d\n" + rows(TIME, ANGLE, TORQUE, RATE), ("--yes",)),
    "windows.csv": ("Time (ms),Torque (N·m),Rate (°/s)\n" + rows(1e3 * TIME, TORQUE, np.degrees(RATE)), ()),
    "mixed_stamps.csv": (  # a logger that leaves fractions of zero out
        "Time;Torque [Nm];Rate [rad/s]\n"
        + stamped("%H:%M:%S.%f", rows(TORQUE, RATE, by=";"), ";").replace(".000000;", ";"),
        (),
    ),
    "matlab_datetime.csv": (
        "Time,Torque_Nm,Rate_deg_s\n" + stamped("%d-%b-%Y %H:%M:%S.%f", rows(TORQUE, np.degrees(RATE)), ","),
        (),
    ),
    "quoted_commas.csv": (
        '"Zeit [s]","Moment [Nm]","Rate [rad/s]"\n'
        + "".join(
            ",".join(f'"{german(f"{v:.12g}")}"' for v in row) + "\n" for row in zip(TIME, TORQUE, RATE, strict=True)
        ),
        (),
    ),
    "tektronix.csv": (
        "Model,MDO3024\nFirmware Version,1.26\n\nPoint Format,Y,,\nHorizontal Units,S,,\nSample Interval,0.002,,\n,,,\n"
        "TIME,Torque (N*m),Gyro (deg/s)\n" + rows(TIME - 0.1, TORQUE, np.degrees(RATE), form="{:.9e}"),
        (),
    ),
    "numbered.csv": (
        "x-axis,1,2\nsecond,N m,deg/s\n" + rows(TIME, TORQUE, np.degrees(RATE), form="{:+.9E}"),
        ("--yes",),
    ),
    "commented.csv": (
        "# bench 3\n#time,torque,rate\n#[ms],[mNm],[deg/s]\n" + rows(1e3 * TIME, 1e3 * TORQUE, np.degrees(RATE)),
        (),
    ),
    "catman.txt": (
        "Messzeit [s]\tMoment [Nm]\tDrehwinkel [°]\n\t\t\n" + german(rows(TIME, TORQUE, np.degrees(ANGLE), by="\t")),
        (),
    ),
    "linear.csv": ("t [s];Kraft [N];Weg [mm]\n" + german(rows(TIME, TORQUE, 1e3 * ANGLE, by=";")), ()),
}
