"""Recordings made by code, changed at random, and those that are made to do harm."""

from __future__ import annotations

import gzip
import io
import json
import os
import pickle
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from drivers.capture.wire_capture import Capture
from drivers.codecs import stim300
from drivers.codecs.lawicel import CanFrame
from rig.recording import Journal, Recording, Run
from rig.recording.hdf5 import write_recording_h5
from rig.recording.tail_file import record, tail_of

ROOT = Path(__file__).resolve().parents[2]
Maker = Callable[[Path], None]
WITNESS = Path(tempfile.gettempdir()) / "isp_rig_fuzz_was_here"  # made by code in a file, if that is ever run


def columns(count: int = 80) -> dict[str, Any]:
    """A motion that is consistent in itself."""
    time_s = np.arange(count) * 1e-3
    return {
        "time_s": time_s,
        "torque_nm": 3 * np.sin(20 * time_s),
        "rate_rad_s": 2 * np.cos(40 * time_s),
        "angle_rad": 0.05 * np.sin(40 * time_s),
    }


def _csv() -> str:
    given = columns()
    rows = zip(*given.values(), strict=True)
    return "\n".join([",".join(given), *(",".join(repr(float(v)) for v in row) for row in rows)]) + "\n"


def _h5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, values in columns().items():
            file.create_dataset(name, data=values, **({"compression": "gzip"} if name == "rate_rad_s" else {}))


def _own(path: Path) -> None:
    given = columns()
    run = Run("r", given["time_s"], np.ones(80, dtype=bool), given["rate_rad_s"], torque_time_s=given["time_s"],
              torque_nm=given["torque_nm"], channels={"drive_torque_nm": given["torque_nm"]})  # fmt: skip
    write_recording_h5(path, Recording((run, run), noise=0.1, info={"a": 1}))


def _journal(path: Path) -> None:
    given = columns()
    with Journal.create(path, {"axis": "rotary", "noise": 0.1}) as journal:
        for name in ("one", "two"):
            meta = {"use": "fit", "torque_hold": "zero_order", "frequency_hz": 3.0}
            journal.begin_run(name, meta, {"ticks": ("time_s", "late_s", "drive_torque_nm")})
            journal.append("samples", np.column_stack((given["time_s"], given["rate_rad_s"], np.ones(80))))
            journal.append("commands", np.column_stack((given["time_s"], given["torque_nm"], given["torque_nm"])))
            journal.append("ticks", np.column_stack((given["time_s"], given["time_s"], given["torque_nm"])))
            journal.event(0.1, "late", {"by": 1})
            journal.end_run()


def _capture(path: Path) -> None:
    written = Capture(path.parent / "made")
    settings = {"torque_constant_nm_a": 0.1, "peak_current_a": 50.0, "timeout_is_set": True}
    amplifier = {"device": "vesc", "node": 1, "settings": settings}
    bench = {"gyroscope": {"settings": {"datagram": 0x90}}, "amplifier": amplifier}
    written.mark(0.0, "config", {"bench": bench})
    beat = CanFrame(9 << 8 | 1, bytes(8), extended=True)
    for k in range(60):
        datagram = stim300.Datagram(0x90, (0, 0, k), 0, k & 255, 500)
        written.gyro_read(k * 1e-3, stim300.encode_datagram(datagram))
        written.can(k * 1e-3, False, beat)
        written.can(k * 1e-3, True, CanFrame(1 << 8 | 1, bytes(4), extended=True))
        if k == 20:
            written.mark(k * 1e-3, "opened")
        if k == 30:
            written.mark(k * 1e-3, "armed")
        written.clock(k * 1e-3)
        if k > 30:
            written.tick(k * 1e-3, 0.0)
    written.close()
    path.write_bytes(written.path.read_bytes())
    written.path.unlink()
    written.path.parent.rmdir()


def _mat(version: str, packed: bool = False, nested: bool = False) -> Maker:
    def make(path: Path) -> None:
        content = {"log": columns()} if nested else columns()
        scipy.io.savemat(path, content, format=version, do_compression=packed)

    return make


MAKERS: Mapping[str, Maker] = {
    "plain.csv": lambda path: path.write_text(_csv()) and None,
    "packed.csv.gz": lambda path: path.write_bytes(gzip.compress(_csv().encode())) and None,
    "stored.npz": lambda path: np.savez(path, **columns()),
    "packed.npz": lambda path: np.savez_compressed(path, **columns()),
    "old.mat": _mat("4"),
    "plain.mat": _mat("5"),
    "packed.mat": _mat("5", packed=True),
    "struct.mat": _mat("5", nested=True),
    "plain.h5": _h5,
    "own.h5": _own,
    "raw.journal": _journal,
    "wire.cap": _capture,
    "drive.eds": lambda path: path.write_bytes(
        (ROOT / "sim_backend" / "emulators" / "cia402_drive.eds").read_bytes()
    ) and None,
}  # fmt: skip


def mutated(data: bytes, random: np.random.Generator) -> bytes:
    """``data`` with a few bytes changed, a stretch cut out, put in or doubled, or its end cut off."""
    changed = bytearray(data)
    for _ in range(1 + int(random.exponential(1.0))):
        # Headers decide how the rest is read: half of the changes go there.
        end = min(len(changed), 600) if random.random() < 0.5 else len(changed)
        at = int(random.integers(0, max(1, end)))
        what = random.random()
        if what < 0.6:
            changed[at : at + 1] = random.bytes(1)
        elif what < 0.75:
            words = (b"\xff" * 4, b"\0" * 4, b"\xff" * 8, b"\x7f" * 4, b"1e999", b"nan", b"-", b",,,", b"\n\n", b'"')
            word = words[int(random.integers(len(words)))]
            changed[at : at + len(word)] = word
        elif what < 0.85:
            del changed[at : at + int(random.integers(1, 30))]
        elif what < 0.95:
            start = int(random.integers(0, max(1, end)))
            changed[at:at] = changed[start : start + int(random.integers(1, 200))]
        else:
            del changed[at + 1 :]
    return bytes(changed)


class _Evil:
    def __reduce__(self) -> Any:
        return os.mkdir, (str(WITNESS),)


def _gzip_of(head: str, line: bytes, megabytes: int) -> Maker:
    def make(path: Path) -> None:
        block = line * (2**20 // len(line))
        with gzip.open(path, "wb", compresslevel=1) as file:
            file.write(head.encode() + b"\n")
            for _ in range(megabytes):
                file.write(block)

    return make


def _npy_header(shape: tuple[int, ...], descr: str) -> bytes:
    text = repr({"descr": descr, "fortran_order": False, "shape": shape}).encode()
    text = text.ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


def _npz_of(member: bytes) -> Maker:
    def make(path: Path) -> None:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in columns():
                archive.writestr(f"{name}.npy", member)

    return make


def _npz_pickle(path: Path) -> None:
    array = io.BytesIO()
    np.save(array, np.array([_Evil()], dtype=object), allow_pickle=True)
    _npz_of(array.getvalue())(path)


def _npz_of_many(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for k in range(20_000):
            archive.writestr(f"{k}.npy", b"")


def _zlib_mat(megabytes: int) -> Maker:
    def make(path: Path) -> None:
        head = b"MATLAB 5.0 MAT-file".ljust(124, b" ") + b"\x00\x01IM"
        packed = zlib.compress(struct.pack("<II", 14, megabytes << 20) + bytes(megabytes << 20), 1)
        path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)

    return make


def _mat_nested(path: Path) -> None:
    scipy.io.savemat(path, {"a": _deep(40)})


def _deep(levels: int) -> Any:
    return columns() if levels == 0 else {"a": _deep(levels - 1)}


def _h5_with(work: Callable[[h5py.File, Path], None], own: bool = False) -> Maker:
    def make(path: Path) -> None:
        (_own if own else _h5)(path)
        with h5py.File(path, "a") as file:
            work(file, path)

    return make


def _external_link(file: h5py.File, path: Path) -> None:
    other = path.with_name("other.h5")
    _h5(other)
    del file["rate_rad_s"], file["angle_rad"]
    file["rate_rad_s"] = h5py.ExternalLink(str(other), "/rate_rad_s")


def _external_storage(file: h5py.File, path: Path) -> None:
    del file["rate_rad_s"], file["angle_rad"]
    file.create_dataset("rate_rad_s", shape=(80,), dtype="f8", external=[("/dev/zero", 0, 640)])


def _virtual(file: h5py.File, path: Path) -> None:
    del file["rate_rad_s"], file["angle_rad"]
    layout = h5py.VirtualLayout(shape=(80,), dtype="f8")
    layout[:] = h5py.VirtualSource("/elsewhere/other.h5", "rate_rad_s", shape=(80,))
    file.create_virtual_dataset("rate_rad_s", layout)


def _huge(file: h5py.File, path: Path) -> None:
    for name in ("time_s", "rate_rad_s"):
        del file[name]
        file.create_dataset(name, shape=(10**12,), dtype="f8", chunks=(10**6,), compression="gzip")


def _own_huge(file: h5py.File, path: Path) -> None:
    del file["runs/000/time_s"]
    file["runs/000"].create_dataset("time_s", shape=(10**12,), dtype="f8", chunks=(10**6,))


def _own_linked(file: h5py.File, path: Path) -> None:
    del file["runs/000/time_s"]
    file["runs/000/time_s"] = h5py.ExternalLink("/elsewhere/other.h5", "/time_s")


def _own_external(file: h5py.File, path: Path) -> None:
    del file["runs/000/time_s"]
    file["runs/000"].create_dataset("time_s", shape=(80,), dtype="f8", external=[("/dev/zero", 0, 640)])


def _own_circle(file: h5py.File, path: Path) -> None:
    file["runs/002"] = file["runs"]


def _own_long_text(path: Path) -> None:
    """The first text's length as its reference states it: some gigabytes."""
    _own(path)
    data = bytearray(path.read_bytes())
    reference = data.index(struct.pack("<Q", data.index(b"GCOL"))) - 4
    assert struct.unpack_from("<I", data, reference)[0] == len("isp-rig recording")
    struct.pack_into("<I", data, reference, 0xFFFFFFF0)
    path.write_bytes(data)


def _own_endless(size: int) -> Maker:
    """The free space at the end of a heap of texts, of such a size that a walk over the heap does not move on."""

    def make(path: Path) -> None:
        _own(path)
        data = bytearray(path.read_bytes())
        at = data.index(b"GCOL") + 16
        while index := struct.unpack_from("<H", data, at)[0]:
            at += 16 + (struct.unpack_from("<Q", data, at + 8)[0] + 7 & ~7)
        assert index == 0
        struct.pack_into("<HHIQ", data, at, 1 if size else 0, 0, 0, size)
        path.write_bytes(data)

    return make


def _journal_tail_lies(path: Path) -> None:
    _journal(path)
    size = path.stat().st_size
    lies = b"".join(struct.pack("<4sQII", b"ISPT", size, 1 << k % 32, 0) for k in range(300_000))
    tail_of(path).write_bytes(lies + record(size + 10**9, b"far behind"))


def _journal_lies(path: Path) -> None:
    _journal(path)
    path.write_bytes(path.read_bytes() + struct.pack("<4sB3xII", b"ISPJ", 3, 1_000_000, 0) * 200_000)


def _journal_deep(path: Path) -> None:
    from rig.recording.journal import HEADER, RUN, frame  # noqa: PLC0415

    deep = b"[" * 100_000 + b"]" * 100_000
    path.write_bytes(frame(HEADER, b"{}") + frame(RUN, b'{"name": ' + deep + b', "meta": {}, "columns": {}}'))


def _journal_odd(path: Path) -> None:
    from rig.recording.journal import HEADER, RUN, frame  # noqa: PLC0415

    head = {"name": ["x"], "meta": {"frequency_hz": "abc", "use": 7}, "columns": {"samples": ["time_s", 5, None]}}
    path.write_bytes(frame(HEADER, b"[1]") + frame(RUN, json.dumps(head).encode()))


def _eds_of(lines: str, times: int) -> Maker:
    def make(path: Path) -> None:
        MAKERS["drive.eds"](path)
        with path.open("a") as file:
            file.write("".join(lines.format(k=k, index=f"{0x2000 + k % 0x3FFF:04X}") for k in range(times)))

    return make


HARMFUL: Mapping[str, Maker] = {
    "refuse empty_lines.csv.gz": _gzip_of("time_s,rate_rad_s", b"\n", 600),
    "refuse zeros.csv.gz": _gzip_of("time_s,rate_rad_s", b"0,0\n", 2000),
    "refuse one_line.csv.gz": _gzip_of("time_s,rate_rad_s", b"0", 300),
    "refuse nul.csv.gz": lambda path: path.write_bytes(gzip.compress(bytes(200 << 20), 1)) and None,
    "refuse wide.csv": lambda path: path.write_text(",".join(f"c{k}" for k in range(8000)) + "\n1\n") and None,
    "refuse quotes.csv": lambda path: path.write_text('time_s,rate_rad_s\n"' + "a\n" * 500_000) and None,
    "refuse pickle.npz": _npz_pickle,
    "refuse raw_pickle.npz": lambda path: path.write_bytes(pickle.dumps(_Evil())) and None,
    "refuse huge_shape.npz": _npz_of(_npy_header((10**12,), "<f8")),
    "refuse negative_shape.npz": _npz_of(_npy_header((-5,), "<f8")),
    "refuse wide_type.npz": _npz_of(_npy_header((3,), "|V2000000000")),
    "refuse text_type.npz": _npz_of(_npy_header((2**62, 2**62), "<f8")),
    "refuse bomb.npz": _npz_of(_npy_header((20_000_000,), "<f8") + bytes(160_000_000)),
    "refuse many.npz": _npz_of_many,
    "refuse bomb.mat": _zlib_mat(1400),
    "refuse deep.mat": _mat_nested,
    "refuse external_link.h5": _h5_with(_external_link),
    "refuse external_storage.h5": _h5_with(_external_storage),
    "refuse virtual.h5": _h5_with(_virtual),
    "refuse huge.h5": _h5_with(_huge),
    "refuse own_huge.h5": _h5_with(_own_huge, own=True),
    "refuse own_linked.h5": _h5_with(_own_linked, own=True),
    "refuse own_external.h5": _h5_with(_own_external, own=True),
    "refuse own_circle.h5": _h5_with(_own_circle, own=True),
    "refuse own_long_text.h5": _own_long_text,
    "refuse own_endless.h5": _own_endless(0),
    "refuse own_round_and_round.h5": _own_endless((1 << 64) - 16),
    "read lies.journal": _journal_lies,
    "read tail_lies.journal": _journal_tail_lies,
    "refuse deep.journal": _journal_deep,
    "refuse odd.journal": _journal_odd,
    "refuse huge.eds": _eds_of("[{index}]\nParameterName=x{k}\nObjectType=0x7\nDataType=0x7\nAccessType=rw\n", 200_000),
    "any compact.eds": _eds_of(
        "\n[{index}]\nParameterName=x\nObjectType=0x8\nDataType=0x7\nAccessType=rw\nCompactSubObj=254\n", 2000
    ),
}  # fmt: skip
