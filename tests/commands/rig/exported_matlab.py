"""Files of MATLAB, Simulink and dSPACE as those save them: the same motion in structures of several shapes."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import savemat

from tests.commands.rig.exported_text import ANGLE, RATE, TIME, TORQUE

DEG_S = np.degrees(RATE)


def elements(**fields: Sequence[Any]) -> np.ndarray:
    """A struct array, 1 x n, as MATLAB has it."""
    count = len(next(iter(fields.values())))
    array = np.zeros((1, count), dtype=[(name, object) for name in fields])
    for name, values in fields.items():
        for i, value in enumerate(values):
            array[0, i][name] = value
    return array


def cell(*values: Any) -> np.ndarray:
    array = np.empty((1, len(values)), dtype=object)
    for i, value in enumerate(values):
        array[0, i] = value
    return array


def column(values: np.ndarray) -> np.ndarray:
    return values.reshape(-1, 1)


def structure_with_time(path: Path) -> None:
    """A scope of Simulink that logs in the format "Structure with time"."""
    signals = elements(
        values=[column(TORQUE), column(DEG_S)],
        dimensions=[1.0, 1.0],
        label=["torque (N m)", "gyro (deg/s)"],
        title=["", ""],
        plotStyle=[np.array([0.0]), np.array([0.0])],
        blockName=["twin/Scope", "twin/Scope"],
    )
    savemat(path, {"ScopeData": {"time": column(TIME), "signals": signals, "blockName": "twin/Scope"}})


def one_signal_of_two_columns(path: Path) -> None:
    """To Workspace, "Structure with time", of a muxed signal."""
    signals = {"values": np.column_stack([TORQUE, RATE]), "dimensions": 2.0, "label": "torque,rate"}
    savemat(path, {"simout": {"time": column(TIME), "signals": signals}})


def several_structures(path: Path) -> None:
    """To Workspace, one structure a signal."""
    out = {}
    for name, values in (("torque", TORQUE), ("rate", RATE)):
        out[name] = {"time": column(TIME), "signals": {"values": column(values), "dimensions": 1.0, "label": ""}}
    savemat(path, out)


def timeseries(path: Path) -> None:
    """``struct(ts)`` of two timeseries."""
    out = {}
    for name, values, unit in (("torque", TORQUE, "N*m"), ("gyro", DEG_S, "deg/s")):
        info = {"Units": unit, "Interpolation": {"Name": "linear"}}
        out[name] = {"Name": name, "Time": column(TIME), "Data": column(values), "DataInfo": info, "Length": 400.0}
    savemat(path, out)


def dataset(path: Path) -> None:
    """``logsout`` made a struct: a cell of elements with Name and Values."""
    made = []
    for name, values, unit in (("torque", TORQUE, "N*m"), ("gyro", DEG_S, "deg/s")):
        inner = {"Time": column(TIME), "Data": column(values), "DataInfo": {"Units": unit}}
        made.append({"Name": name, "PropagatedName": "", "Values": inner, "BlockPath": f"twin/{name}"})
    savemat(path, {"logsout": {"Name": "logsout", "Element": cell(*made)}})


def to_file(path: Path) -> None:
    """To File, format "Array": the first row is the time."""
    savemat(path, {"ans": np.vstack([TIME, TORQUE, RATE])})


def named_matrix(path: Path) -> None:
    """An array of n x 4 beside a cell of names."""
    data = np.column_stack([TIME, TORQUE, RATE, ANGLE])
    savemat(path, {"data": data, "names": cell("time_s", "torque_nm", "rate_rad_s", "angle_rad")})


def matrix(path: Path) -> None:
    savemat(path, {"data": np.column_stack([TIME, TORQUE, RATE, ANGLE])})


def char_names(path: Path) -> None:
    """Names as a char matrix, padded with spaces; the data with a sample rate and without a time."""
    names = np.array(["torque (N m)", "rate (rad/s)"])
    savemat(path, {"Y": np.column_stack([TORQUE, RATE]), "labels": names, "Fs": 500.0})


def control_desk(path: Path, **options: Any) -> None:
    """dSPACE ControlDesk: X has the times of the rasters, Y the signals."""
    x = elements(
        Name=["", ""],
        Type=[1.0, 1.0],
        Data=[TIME[None, :], TIME[None, ::10]],
        Raster=["HostService", "Slow"],
        Unit=["s", "s"],
    )
    y = elements(
        Name=["Torque_act", "Gyro_rate", "T_motor"],
        Type=[1.0, 1.0, 1.0],
        Data=[TORQUE[None, :], DEG_S[None, :], 20.0 + TIME[None, ::10]],
        Raster=["HostService", "HostService", "Slow"],
        Unit=["Nm", "deg/s", "°C"],
        Path=["Model Root/Drive", "Model Root/Gyro", "Model Root/Motor"],
        XIndex=[1.0, 1.0, 2.0],
    )
    capture = {"X": x, "Y": y, "Description": {"General": {"Version": "2.0"}}, "Capture": {"Comment": ""}}
    savemat(path, {"exp_001": capture}, **options)


def timetable(path: Path) -> None:
    """``table2struct(T, "ToScalar", true)``."""
    savemat(path, {"T": {"Time": column(TIME), "Torque_Nm": column(TORQUE), "Gyro_dps": column(DEG_S)}})


def records(path: Path) -> None:
    """``table2struct(T)``: a struct a row."""
    savemat(path, {"S": elements(t=list(TIME), torque_nm=list(TORQUE), rate_rad_s=list(RATE))})


def version_7_3(path: Path) -> None:
    """Structure with time as -v7.3 writes it: HDF5 with references to what the struct array holds."""
    with h5py.File(path, "w", userblock_size=512) as file:
        refs = file.create_group("#refs#")

        def text(group: h5py.Group, name: str, value: str) -> h5py.Dataset:
            made = group.create_dataset(name, data=np.array([[ord(c)] for c in value], dtype=np.uint16))
            made.attrs["MATLAB_class"] = np.bytes_("char")
            made.attrs["MATLAB_int_decode"] = np.int32(2)
            return made

        def number(group: h5py.Group, name: str, values: np.ndarray) -> h5py.Dataset:
            made = group.create_dataset(name, data=values)
            made.attrs["MATLAB_class"] = np.bytes_("double")
            return made

        scope = file.create_group("ScopeData")
        scope.attrs["MATLAB_class"] = np.bytes_("struct")
        number(scope, "time", TIME[None, :])
        signals = scope.create_group("signals")
        signals.attrs["MATLAB_class"] = np.bytes_("struct")
        for field, made in (
            ("values", [number(refs, "b", TORQUE[None, :]), number(refs, "c", DEG_S[None, :])]),
            ("label", [text(refs, "d", "torque (N m)"), text(refs, "e", "gyro (deg/s)")]),
        ):
            references = np.array([[one.ref] for one in made], dtype=h5py.ref_dtype)
            signals.create_dataset(field, data=references, dtype=h5py.ref_dtype)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Wed May  1 12:00:00 2024 HDF5 schema 1.00 ."
    with path.open("r+b") as out:
        out.write(head.ljust(116) + bytes(8) + b"\x00\x02IM")


def frame_of_pandas(path: Path) -> None:
    """``DataFrame.to_hdf``: a block of values and the names of its columns (PyTables' layout)."""
    with h5py.File(path, "w") as file:
        group = file.create_group("run1")
        group.attrs["pandas_type"] = np.bytes_("frame")
        names = np.array([b"time_s", b"torque_nm", b"rate_rad_s"])
        group.create_dataset("axis0", data=names)
        group.create_dataset("axis1", data=np.arange(len(TIME)))
        group.create_dataset("block0_items", data=names)
        group.create_dataset("block0_values", data=np.column_stack([TIME, TORQUE, RATE]))


def table_of_pytables(path: Path) -> None:
    """A table of PyTables: one dataset of a compound type."""
    rows = np.zeros(len(TIME), dtype=[("time_s", "f8"), ("torque_nm", "f8"), ("rate_rad_s", "f4")])
    rows["time_s"], rows["torque_nm"], rows["rate_rad_s"] = TIME, TORQUE, RATE
    with h5py.File(path, "w") as file:
        made = file.create_group("log").create_dataset("samples", data=rows)
        made.attrs["CLASS"] = np.bytes_("TABLE")


def npz_matrix(path: Path) -> None:
    np.savez(path, data=np.column_stack([TIME, TORQUE, RATE]), columns=np.array(["time_s", "torque_nm", "rate_rad_s"]))


def npz_records(path: Path) -> None:
    rows = np.rec.fromarrays([TIME, TORQUE, RATE], names="time_s,torque_nm,rate_rad_s")
    np.savez(path, run1=rows)


def npy_records(path: Path) -> None:
    rows = np.rec.fromarrays([TIME, TORQUE, RATE], names="time_s,torque_nm,rate_rad_s")
    np.save(path, rows)


def with_an_object(path: Path) -> None:
    """A timetable, which MATLAB keeps in a form of its own: an array of class 17 whose rest only MATLAB can open."""

    def element(kind: int, content: bytes) -> bytes:
        return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)

    def matrix(flags: int, *parts: bytes) -> bytes:
        return element(14, element(6, struct.pack("<II", flags, 0)) + b"".join(parts))

    shape = element(5, struct.pack("<ii", 6, 1))
    inner = matrix(13, shape, element(1, b""), element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1)))
    table = matrix(17, element(1, b"T"), element(1, b"MCOS"), element(1, b"timetable"), inner)
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + table)


# File -> what writes it, and the options that a person would need.
READ: dict[str, tuple[Callable[[Path], None], Sequence[str]]] = {
    "structure_with_time.mat": (structure_with_time, ()),
    "muxed.mat": (one_signal_of_two_columns, ("--yes",)),
    "to_workspace.mat": (several_structures, ("--yes",)),
    "timeseries.mat": (timeseries, ()),
    "logsout.mat": (dataset, ()),
    "to_file.mat": (to_file, ("--yes",)),
    "named_matrix.mat": (named_matrix, ()),
    "matrix.mat": (matrix, ("--yes",)),
    "char_names.mat": (char_names, ("--yes",)),
    "controldesk.mat": (control_desk, ()),
    "table2struct.mat": (timetable, ()),
    "records.mat": (records, ("--yes",)),
    "v73.mat": (version_7_3, ()),
    "pandas.h5": (frame_of_pandas, ()),
    "pytables.h5": (table_of_pytables, ()),
    "matrix.npz": (npz_matrix, ()),
    "records.npz": (npz_records, ()),
    "records.npy": (npy_records, ()),
}
