"""Files as other tools export them, written by code: the same motion in binary formats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from tests.commands.rig.exported_text import ANGLE, RATE, TIME, TORQUE

START_NS = 1_714_564_800_000_000_000
FINE = np.arange(799) * 1e-3  # the times of a group that is sampled twice as fast
SLOW = np.arange(0.0, 0.81, 0.05)


def parquet(path: Path) -> None:
    """As pandas writes a frame with a time index, the units in the fields' metadata."""
    stamps = pa.array(START_NS + np.round(1e9 * TIME).astype(np.int64), pa.timestamp("ns", "UTC"))
    fields = [
        pa.field("torque", pa.float64(), metadata={"unit": "N m"}),
        pa.field("gyro", pa.float64(), metadata={"unit": "deg/s"}),
        pa.field("__index_level_0__", stamps.type),
    ]
    pq.write_table(pa.table([TORQUE, np.degrees(RATE), stamps], schema=pa.schema(fields)), path)


def parquet_named(path: Path) -> None:
    """As polars writes a frame whose names carry the units."""
    pq.write_table(pa.table({"time_ms": 1e3 * TIME, "torque_Nm": TORQUE, "angle_deg": np.degrees(ANGLE)}), path)


def mf4(path: Path) -> None:
    """One raster, as a calibration tool writes it; channels beside that are no part of it."""
    with MDF() as file:
        file.append(
            [
                Signal(TORQUE, TIME + 3.0, "Nm", "MotorTorque"),
                Signal(np.degrees(RATE), TIME + 3.0, "deg/s", "GyroZ_rate"),
                Signal(np.full(len(TIME), 24.1), TIME + 3.0, "V", "U_Batt"),
            ]
        )
        file.save(path)


def mf4_rasters(path: Path) -> None:
    """Torque and rate in two rasters and a temperature in a third."""
    with MDF() as file:
        file.append([Signal(np.interp(FINE, TIME, TORQUE), FINE, "Nm", "Torque")])
        file.append([Signal(RATE, TIME, "rad/s", "Rate")])
        file.append([Signal(20.0 + SLOW, SLOW, "degC", "T_winding")])
        file.save(path)


def mf4_can(path: Path) -> None:
    """A log of raw CAN frames without signals."""
    kinds = [("CAN_DataFrame.BusChannel", "<u1"), ("CAN_DataFrame.ID", "<u4"), ("CAN_DataFrame.DataBytes", "(8,)u1")]
    frames = np.zeros(len(TIME), dtype=kinds)
    with MDF() as file:
        file.append([Signal(frames, TIME, name="CAN_DataFrame")])
        file.save(path)


def tdms(path: Path) -> None:
    """Waveforms, as LabVIEW's DAQmx logs them: the time is an increment."""
    with TdmsWriter(path) as file:
        file.write_segment(
            [
                ChannelObject("DAQ", name, values, {"wf_increment": 2e-3, "wf_start_offset": 0.0, "unit_string": unit})
                for name, values, unit in (("Torque", TORQUE, "N m"), ("Gyro rate", np.degrees(RATE), "deg/s"))
            ]
        )


def tdms_with_time(path: Path) -> None:
    """The time as a channel of stamps, as DIAdem writes it."""
    stamps = np.datetime64("2024-05-01T12:00:00") + np.round(1e6 * TIME).astype("timedelta64[us]")
    with TdmsWriter(path) as file:
        file.write_segment(
            [
                ChannelObject("Log", "Time", stamps),
                ChannelObject("Log", "Torque", TORQUE, {"unit_string": "Nm"}),
                ChannelObject("Log", "Angle", np.degrees(ANGLE), {"unit_string": "deg"}),
            ]
        )


def _imu(store: Any, ros: int, i: int) -> Any:
    types = store.types
    header = {"stamp": _stamp(types, i), "frame_id": "imu"}
    header |= {"seq": i} if ros == 1 else {}
    vector = types["geometry_msgs/msg/Vector3"]
    return types["sensor_msgs/msg/Imu"](
        types["std_msgs/msg/Header"](**header),
        types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        np.zeros(9),
        vector(0.001 * i, 0.0, float(RATE[i])),
        np.zeros(9),
        vector(0.0, 0.0, 9.81),
        np.zeros(9),
    )


def _joint(store: Any, ros: int, i: int) -> Any:
    types = store.types
    header = {"stamp": _stamp(types, i), "frame_id": ""} | ({"seq": i} if ros == 1 else {})
    one = [np.array([float(v)]) for v in (ANGLE[i], RATE[i], TORQUE[i])]
    return types["sensor_msgs/msg/JointState"](types["std_msgs/msg/Header"](**header), ["axis1"], *one)


def _stamp(types: Any, i: int) -> Any:
    ns = START_NS + round(1e9 * TIME[i])
    return types["builtin_interfaces/msg/Time"](int(ns // 10**9), int(ns % 10**9))


def ros1(path: Path) -> None:
    """A bag of ROS 1: an IMU beside the joint's state."""
    store = get_typestore(Stores.ROS1_NOETIC)
    with rosbag1.Writer(path) as bag:
        joints = bag.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        imu = bag.add_connection("/imu/data", "sensor_msgs/msg/Imu", typestore=store)
        for i in range(len(TIME)):
            late = START_NS + round(1e9 * TIME[i]) + 150_000 * (i % 7)  # when it came; the header says when it was
            joint = store.serialize_ros1(_joint(store, 1, i), "sensor_msgs/msg/JointState")
            bag.write(joints, late, joint)
            bag.write(imu, late, store.serialize_ros1(_imu(store, 1, i), "sensor_msgs/msg/Imu"))


def ros2(path: Path) -> None:
    """A bag of ROS 2: a folder."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    plugin = rosbag2.StoragePlugin.MCAP if path.name.endswith("mcap") else rosbag2.StoragePlugin.SQLITE3
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as bag:
        joints = bag.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        for i in range(len(TIME)):
            message = store.serialize_cdr(_joint(store, 2, i), "sensor_msgs/msg/JointState")
            bag.write(joints, START_NS + round(1e9 * TIME[i]), message)


# File -> what writes it, and the options that a person would need; read at the first try, without a terminal.
READ: dict[str, tuple[Callable[[Path], None], Sequence[str]]] = {
    "frame.parquet": (parquet, ()),
    "named.parquet": (parquet_named, ()),
    "inca.mf4": (mf4, ()),
    "rasters.mf4": (mf4_rasters, ()),
    "daqmx.tdms": (tdms, ()),
    "diadem.tdms": (tdms_with_time, ()),
    "rosbag1.bag": (ros1, ("--rate", "joint_states.velocity[axis1]")),
    "rosbag2": (ros2, ()),
    "rosbag2_mcap": (ros2, ()),
}
