"""Every file that cannot be read is refused with its cause and its cure."""

from __future__ import annotations

import gzip
import io
import os
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from rig.recording.journal import HEADER, RUN, Journal, frame
from rig.recording.readers.matlab import mat
from tests.rig.recording.support import csv_of, motion, refusal

Columns = dict[str, Any]


def changed(**columns: Any) -> Columns:
    return motion() | columns


def without(*names: str) -> Columns:
    return {name: values for name, values in motion().items() if name not in names}


T = motion()["time_s"]
GOOD = csv_of(motion())
LINES = GOOD.splitlines()


def line_replaced(number: int, text: str) -> str:
    return "\n".join([*LINES[: number - 1], text, *LINES[number:]])


# text of run.csv, then cause and cure
TEXTS = {
    "text in a number": (line_replaced(7, "0.005,oops,2,0"), "line 7, column 'torque_nm': 'oops'", "valid"),
    "row of unknown units": (
        line_replaced(2, "foo,bar,baz,qux"),
        "column 'time_s': 'foo'",
        "a row of units that are not",
    ),
    "underscore": (line_replaced(7, "0.005,1_000,2,0"), "line 7, column 'torque_nm': '1_000'", "correct it"),
    "empty time": (line_replaced(7, ",1,2,0"), "line 7: time is nan", "mark the row valid = 0"),
    "cut row": (line_replaced(7, "0.005,1,2"), "line 7 has 3 fields where the header names 4", "complete or delete"),
    "row too long": (line_replaced(7, "0.005,1,2,0,9"), "line 7 has 5 fields", "complete or delete"),
    "decimal commas between commas": (
        GOOD.replace(",", ";").replace(".", ",").replace(";", ",").replace("time_s;", "time_s,"),
        "fields where the header names 4",
        "separate the columns by semicolons",
    ),
    "no header": ("\n".join(LINES[1:]), "line 1 holds numbers where the header", "names the columns"),
    "only a header": (LINES[0] + "\n", "only a header, no data", "export the recording again"),
    "only comments": ("# a\n# b\n", "holds no data", "a header line"),
    "column twice": (
        GOOD.replace("angle_rad", "rate_rad_s"),
        "names 'rate_rad_s' twice",
        "rename one",
    ),
    "endless line": ("time_s," + "x" * 100_000, "longer than 65536 characters", "one sample a line"),
    "wrong delimiter": (GOOD.replace(",", "~"), "has no column 'time_s'", "recorded.columns.time"),
}


@pytest.mark.parametrize("case", TEXTS)
def test_text_that_cannot_be_trusted_is_refused(tmp_path: Path, case: str) -> None:
    text, cause, cure = TEXTS[case]
    (tmp_path / "run.csv").write_text(text)
    message = refusal(tmp_path, "run.csv")
    assert cause in message
    assert cure in message


def test_the_line_is_right_behind_comments_and_blank_lines(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("# made by hand\n\n" + line_replaced(7, ",1,2,0"))
    assert "line 9: time is nan" in refusal(tmp_path, "run.csv")


def npy(values: Any) -> bytes:
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()


def object_array(path: Path) -> None:
    np.savez(path, **changed(torque_nm=np.array([{}] * 500, dtype=object)))


def announced_array(path: Path) -> None:
    """A few bytes whose header announces a terabyte."""
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (137438953472,), }"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("time_s.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header)
        archive.writestr("rate_rad_s.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header)


def cut_npz(path: Path) -> None:
    np.savez(path, **motion())
    path.write_bytes(path.read_bytes()[:3000])


def flipped_npz(path: Path) -> None:
    np.savez(path, **motion())
    data = bytearray(path.read_bytes())
    data[1000] ^= 0xFF
    path.write_bytes(bytes(data))


def compressed_mat_bomb(path: Path) -> None:
    packer = zlib.compressobj()
    packed = b"".join(packer.compress(bytes(1 << 20)) for _ in range(3)) + packer.flush()
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)


def gzip_cut(path: Path) -> None:
    path.write_bytes(gzip.compress(GOOD.encode())[:2000])


def h5_elsewhere(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, values in without("angle_rad").items():
            file[name] = values
        file.create_dataset("angle_rad", (500,), "f8", external=[("/etc/passwd", 0, 4000)])


def h5_link_elsewhere(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["time_s"] = T
        file["rate_rad_s"] = h5py.ExternalLink("other.h5", "/rate_rad_s")
    with h5py.File(path.with_name("other.h5"), "w") as other:
        other["rate_rad_s"] = motion()["rate_rad_s"]


def foreign_journal(path: Path) -> None:
    """Sound frames with other contents than ours."""
    journal = Journal.create(path, {})
    journal.begin_run("r", {}, {"samples": ("t", "w")})
    journal.append("samples", (0.0, 1.0))
    journal.close()


FILES: dict[str, tuple[str, Callable[[Path], Any], str, str]] = {
    "empty": ("run.csv", lambda p: p.write_bytes(b""), "the file is empty", "export the recording again"),
    "folder": ("run.csv", lambda p: p.mkdir(), "is a folder", "name one file of it"),
    "unknown suffix": (
        "run.feather",
        lambda p: p.write_bytes(b"PK"),
        "'.feather' is not a known format",
        ".csv, .csv.gz",
    ),
    "binary in a csv": ("run.csv", lambda p: p.write_bytes(bytes(range(256))), "is not a text file", "as CSV"),
    "no gzip": ("run.csv.gz", lambda p: p.write_text(GOOD), "cannot be read", "export the file again"),
    "cut gzip": ("run.csv.gz", gzip_cut, "ended before the end-of-stream", "export the file again"),
    "no npz": ("run.npz", lambda p: p.write_text(GOOD), "is not a .npz archive", "numpy.savez"),
    "npy named npz": ("run.npz", lambda p: p.write_bytes(npy(T)), "is not a .npz archive", "numpy.savez"),
    "cut npz": ("run.npz", cut_npz, "is not a .npz archive", "numpy.savez"),
    "damaged npz": ("run.npz", flipped_npz, "is damaged", "export the file again"),
    "npz without arrays": ("run.npz", np.savez, "holds no arrays", "numpy.savez"),
    "npz of objects": ("run.npz", object_array, "never loaded (they can run code)", "save it as numbers"),
    "npz that announces a terabyte": ("run.npz", announced_array, "137438953472 samples", "cut it into runs"),
    "no mat": ("run.mat", lambda p: p.write_text(GOOD), "is not a .mat file", "'-v7'"),
    "mat bomb": ("run.mat", compressed_mat_bomb, "unpacks to more than", "save fewer variables"),
    "empty mat": ("run.mat", lambda p: scipy.io.savemat(p, {}), "holds no variables", "as vectors"),
    "no hdf5": ("run.h5", lambda p: p.write_text(GOOD), "is not an HDF5 file", "export it again"),
    "empty hdf5": ("run.h5", lambda p: h5py.File(p, "w").close(), "holds no datasets", "write time_s"),
    "hdf5 with values elsewhere": ("run.h5", h5_elsewhere, "keeps its values in another file", "copy them"),
    "hdf5 that links elsewhere": ("run.h5", h5_link_elsewhere, "no column 'rate_rad_s'", "recorded.columns"),
    "no journal": ("run.journal", lambda p: p.write_text(GOOD), "not a journal", "results folder"),
    "header that is a list": (
        "run.journal",
        lambda p: p.write_bytes(frame(HEADER, b"[]")),
        "not a journal",
        "results folder",
    ),
    "frame that is no JSON": (
        "run.journal",
        lambda p: p.write_bytes(frame(HEADER, b"{}") + frame(RUN, b"[" * 100_000)),
        "not in the format of this version",
        "the version that wrote it",
    ),
    "journal of another program": ("run.journal", foreign_journal, "not in the format of this version", "wrote it"),
    "journal without samples": (
        "run.journal",
        lambda p: Journal.create(p, {}).close(),
        "no run in it has a sample",
        "play it again",
    ),
}


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path, case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name, make, cause, cure = FILES[case]
    monkeypatch.setattr(mat, "MAX_UNPACKED_BYTES", 2 << 20)
    make(tmp_path / name)
    message = refusal(tmp_path, name)
    assert cause in message
    assert cure in message


def test_a_missing_file_lists_what_is_there(tmp_path: Path) -> None:
    (tmp_path / "run1.csv").write_text(GOOD)
    message = refusal(tmp_path, "run2.csv")
    assert "no such file" in message
    assert "there are: run1.csv" in message


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_is_refused_instead_of_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "run.csv")
    assert "not a regular file (a pipe or device): save the data to a file first" in refusal(tmp_path, "run.csv")


def test_a_device_is_refused(tmp_path: Path) -> None:
    if not Path("/dev/zero").exists():
        pytest.skip("no /dev/zero on this system")
    assert "not a regular file" in refusal(tmp_path, "/dev/zero")


def test_a_home_that_does_not_exist_is_said(tmp_path: Path) -> None:
    message = refusal(tmp_path, "~no-such-user-here/run.csv")
    assert "the home folder (~) is unknown" in message
    assert "give the absolute path" in message


def test_all_wrong_files_are_said_at_once(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text("time_s,torque_nm\n0,1\n")
    (tmp_path / "c.txt").write_bytes(b"")
    message = refusal(tmp_path, "a.csv", entry="    - file: b.csv\n    - file: c.txt\n")
    assert [line.split(": ")[0].rpartition("/")[2] for line in message.splitlines()] == ["a.csv", "b.csv", "c.txt"]


def test_a_fault_that_several_files_share_is_said_once_with_their_names(tmp_path: Path) -> None:
    for name in "abcdefg":
        (tmp_path / f"{name}.csv").write_text(csv_of(motion(20 + ord(name) - ord("a"))))
    entries = "".join(f"    - file: {name}.csv\n" for name in "bcdefg")
    message = refusal(tmp_path, "a.csv", entry=f"{entries}    - file: gone.csv\n")
    first, second = message.splitlines()
    assert "a.csv: 20 valid samples, at least 40 are needed" in first
    assert first.endswith("(the same in b.csv, c.csv, d.csv, e.csv and 2 more)")
    assert "gone.csv: no such file" in second and "the same" not in second


def test_a_stretch_cannot_be_fitted_and_held_out(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", **motion())
    entry = "      use: fit\n      to_s: 0.3\n    - {file: run.npz, use: holdout, from_s: 0.2}\n"
    message = refusal(tmp_path, "run.npz", entry=entry)
    assert "0.2 to 0.3 s has both use: fit and use: holdout" in message
    assert "do not overlap" in message
