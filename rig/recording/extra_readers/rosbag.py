"""Bags of ROS 1 (.bag) and ROS 2 (a folder with metadata.yaml, or its .mcap or .db3), by rosbags.

Every topic is a group of channels: the numbers of its messages, by their place in them. The time is that of the header
where a message has one, else when it was recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import RecordingError
from rig.recording.extra_readers.packages import require
from rig.recording.rasters import Group, one_table
from rig.recording.readers.folder import ROS_METADATA
from rig.recording.table import MAX_SAMPLES, Table, too_long
from rig.units import NS

MAX_ENTRIES = 12  # of an array in a message: joints and vectors, no images and point clouds
SKIPPED = ("header", "orientation")  # a quaternion is no angle
# By message type and field: the units that the ROS definitions fix (REP 103).
UNITS = {
    "sensor_msgs/msg/Imu": {"angular_velocity": "rad/s", "linear_acceleration": "m/s^2"},
    "sensor_msgs/msg/JointState": {"position": "rad", "velocity": "rad/s", "effort": "N m"},
    "geometry_msgs/msg/Wrench": {"torque": "N m", "force": "N"},
    "geometry_msgs/msg/WrenchStamped": {"wrench.torque": "N m", "wrench.force": "N"},
    "geometry_msgs/msg/Vector3Stamped": {},
}


def read(path: Path) -> Sequence[Table]:
    """One table. Raises RecordingError where rosbags is missing, or the bag is damaged or of another kind."""
    require("rosbags", path, "rosbag")
    from rosbags.highlevel import AnyReader  # noqa: PLC0415  an extra, and slow to import
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    bag = path if path.is_dir() or path.suffix.lower() == ".bag" else path.parent
    if bag.is_dir() and not (bag / ROS_METADATA).is_file():
        raise RecordingError(f"{path}: {ROS_METADATA} of the bag is missing: restore it with `ros2 bag reindex`")
    try:
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            if reader.message_count > MAX_SAMPLES:
                raise too_long(path, reader.message_count)
            groups = [g for topic in reader.topics if (g := _group(reader, topic)) is not None]
    except RecordingError:
        raise
    except Exception as error:
        raise RecordingError(
            f"{path}: is not a valid ROS bag ({error}): record it again, or export it as CSV"
        ) from error
    return [one_table(path, groups)]


def _group(reader: Any, topic: str) -> Group | None:
    """One topic; None where its messages hold no numbers or change their shape."""
    connections = [c for c in reader.connections if c.topic == topic]
    times, rows = list[float](), list[dict[str, float]]()
    first_ns = None
    for connection, recorded_ns, raw in reader.messages(connections):
        message = reader.deserialize(raw, connection.msgtype)
        ns = _stamp_ns(message) or recorded_ns
        first_ns = reader.start_time if first_ns is None else first_ns
        times.append(NS * (ns - first_ns))
        rows.append(dict(_numbers(message, "")))
    names = [n for n in rows[0] if all(n in row for row in rows)] if rows else []
    if not names:
        return None
    short = topic.strip("/").replace("/", ".")
    columns = {f"{short}.{n}": np.array([row[n] for row in rows]) for n in names}
    known = UNITS.get(connections[0].msgtype, {})
    units = {f"{short}.{n}": unit for n in names for field, unit in known.items() if n.startswith(field)}
    return Group(short, np.array(times), columns, units)


def _stamp_ns(message: Any) -> int:
    """Time of the message's header in ns, 0 where it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _numbers(message: Any, prefix: str) -> Iterator[tuple[str, float]]:
    """Every number of a message by its place, "angular_velocity.z", "velocity[joint1]"."""
    labels = getattr(message, "name", None)
    for field in getattr(message, "__dataclass_fields__", ()):
        value = getattr(message, field)
        if field in SKIPPED or field.startswith("__") or field.endswith("covariance"):
            continue
        if isinstance(value, bool | int | float | np.number):
            yield f"{prefix}{field}", float(value)
        elif isinstance(value, np.ndarray | list) and 0 < len(value) <= MAX_ENTRIES:
            for i, entry in enumerate(value):
                if isinstance(entry, int | float | np.number):
                    label = labels[i] if isinstance(labels, list) and len(labels) == len(value) else i
                    yield f"{prefix}{field}[{label}]", float(entry)
        elif hasattr(value, "__dataclass_fields__"):
            yield from _numbers(value, f"{prefix}{field}.")
