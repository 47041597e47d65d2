"""Binary files as other tools export them, in layouts that differ from the usual ones: the same motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
from asammdf import MDF, Signal
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from rosbags import rosbag2
from rosbags.typesys import Stores, get_typestore

from tests.commands.rig.exported_text import ANGLE, RATE, TIME, TORQUE

START_NS = 1_714_564_800_000_000_000
DEG_S = np.degrees(RATE)


def pandas_duration(path: Path) -> None:
    """pandas with a TimedeltaIndex, single precision."""
    index = pa.array(np.round(1e9 * TIME).astype(np.int64), pa.duration("ns"))
    columns = {"torque_Nm": TORQUE.astype(np.float32), "gyro_deg_s": DEG_S.astype(np.float32)}
    pq.write_table(pa.table({**columns, "__index_level_0__": index}), path)


def pandas_nullable(path: Path) -> None:
    """A DatetimeIndex of a name, nullable numbers, a column of categories."""
    stamps = pa.array(START_NS + np.round(1e9 * TIME).astype(np.int64), pa.timestamp("ns"))
    torque = pa.array([float(v) for v in TORQUE])
    mode = pa.array(["run"] * len(TIME)).dictionary_encode()
    pq.write_table(pa.table({"torque [N m]": torque, "rate [deg/s]": DEG_S, "mode": mode, "when": stamps}), path)


def mf4_scaled(path: Path) -> None:
    """CANape: raw integers with a linear conversion, names with the device behind a backslash."""
    per_bit = 1e-8
    conversion = {"a": per_bit, "b": 0.0}
    raw = np.round(TORQUE / per_bit).astype(np.int32)
    with MDF() as file:
        torque = Signal(raw, TIME + 12.5, "Nm", "MotTrq\\XCP:1", conversion=conversion)
        file.append([torque, Signal(DEG_S, TIME + 12.5, "°/s", "GyroZ\\XCP:1")])
        file.save(path)


def mdf3(path: Path) -> None:
    """INCA's MDF 3.3, called .dat."""
    with MDF(version="3.30") as file:
        file.append([Signal(TORQUE, TIME, "Nm", "Trq_act"), Signal(RATE, TIME, "rad/s", "Gyro_rate")])
        file.save(path.with_suffix(".mdf"))
    path.with_suffix(".mdf").rename(path)


def tdms_groups(path: Path) -> None:
    """FlexLogger: a group a module, times of begin, units, and properties everywhere."""
    begin = np.datetime64("2024-05-01T12:00:00.000000")
    objects: list[Any] = [RootObject({"name": "run 1", "operator": "lab"})]
    for group, name, values, unit in (("cDAQ1Mod1", "Torque", TORQUE, "N·m"), ("cDAQ1Mod2", "Gyro_Z", DEG_S, "deg/s")):
        said = {"wf_increment": 2e-3, "wf_start_time": begin, "unit_string": unit, "wf_samples": 400}
        objects += [GroupObject(group, {}), ChannelObject(group, name, values, said)]
    with TdmsWriter(path) as file:
        file.write_segment(objects)


def tdms_untitled(path: Path) -> None:
    """LabVIEW's Write To Measurement File without titles; the time a channel of numbers."""
    with TdmsWriter(path) as file:
        pairs = (("Time (s)", TIME), ("Torque (Nm)", TORQUE), ("Angle (deg)", np.degrees(ANGLE)))
        file.write_segment([ChannelObject("Untitled", name, values) for name, values in pairs])


def ros2_three_topics(path: Path) -> None:
    """JointState without rates, Imu, and WrenchStamped of a robot's bag."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    vector = types["geometry_msgs/msg/Vector3"]
    turned = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)

    def head(i: int) -> Any:
        ns = START_NS + round(1e9 * TIME[i])
        return types["std_msgs/msg/Header"](
            types["builtin_interfaces/msg/Time"](int(ns // 10**9), int(ns % 10**9)), "x"
        )

    with rosbag2.Writer(path, version=9) as bag:
        to = {
            kind: bag.add_connection(topic, kind, typestore=store)
            for topic, kind in (
                ("/joint_states", "sensor_msgs/msg/JointState"),
                ("/imu/data", "sensor_msgs/msg/Imu"),
                ("/ft_sensor/wrench", "geometry_msgs/msg/WrenchStamped"),
            )
        }

        def write(message: Any, i: int) -> None:
            kind = message.__msgtype__
            bag.write(to[kind], START_NS + round(1e9 * TIME[i]) + 300_000, store.serialize_cdr(message, kind))

        for i in range(len(TIME)):
            empty = np.array([])
            joint = types["sensor_msgs/msg/JointState"]
            write(joint(head(i), ["axis1"], np.array([ANGLE[i]]), empty, empty), i)
            wrench = types["geometry_msgs/msg/Wrench"](vector(0.0, 0.0, 0.0), vector(0.0, 0.0, float(TORQUE[i])))
            write(types["geometry_msgs/msg/WrenchStamped"](head(i), wrench), i)
            rate, zero = vector(0.0, 0.0, float(RATE[i])), vector(0.0, 0.0, 9.81)
            none = np.zeros(9)
            write(types["sensor_msgs/msg/Imu"](head(i), turned, none, rate, none, zero, none), i)


def workbook(path: Path) -> None:
    """A measurement in Excel: notes on a sheet of their own, a title, names, units, and times as dates."""
    book = openpyxl.Workbook()
    book.active.append(["Bench 3", "operator: lab"])
    sheet = book.create_sheet("Data")
    for row in (["Run 1"], [], ["Time", "Torque", "Rate"], ["", "N m", "deg/s"]):
        sheet.append(row)
    begin = datetime(2024, 5, 1, 12)
    for at, torque, rate in zip(TIME, TORQUE, DEG_S, strict=True):
        sheet.append([begin + timedelta(seconds=float(at)), float(torque), float(rate)])
    book.save(path)


def workbook_of_numbers(path: Path) -> None:
    """A table of numbers with units behind the names, a remark in one row, behind it a chart's sheet."""
    book = openpyxl.Workbook()
    book.active.append(["t (ms)", "M (mN m)", "phi (deg)", "remark"])
    for i, row in enumerate(zip(1e3 * TIME, 1e3 * TORQUE, np.degrees(ANGLE), strict=True)):
        book.active.append([*map(float, row), "begun" if i == 3 else None])
    book.create_sheet("Chart")
    book.save(path)


READ: dict[str, tuple[Callable[[Path], None], Sequence[str]]] = {
    "duration.parquet": (pandas_duration, ()),
    "nullable.parquet": (pandas_nullable, ()),
    "canape.mf4": (mf4_scaled, ()),
    "inca.dat": (mdf3, ()),
    "flexlogger.tdms": (tdms_groups, ()),
    "untitled.tdms": (tdms_untitled, ()),
    "bench.xlsx": (workbook, ()),
    "numbers.xlsx": (workbook_of_numbers, ()),
    "ros2_three": (ros2_three_topics, ("--yes",)),
}
