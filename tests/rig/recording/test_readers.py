"""The same motion reads the same from every format, under any names and units."""

from __future__ import annotations

import gzip
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from rig.recording import Journal, Run
from tests.rig.recording.support import csv_of, motion, read

SHARED = Path(__file__).parents[4] / "shared" / "data"


def to_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def quoted(text: str) -> str:
    """Every field between quotes, as some loggers write them."""
    return "".join('"' + line.replace(",", '","') + '"\n' for line in text.splitlines())


def to_h5(path: Path, group: str = "/") -> None:
    with h5py.File(path, "w") as file:
        for name, values in motion().items():
            file[f"{group}/{name}"] = values


def to_mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in motion().items():
            file[name] = values.reshape(1, -1)  # MATLAB's columns, as HDF5 sees them
    data = bytearray(path.read_bytes())
    data[:20] = b"MATLAB 7.3 MAT-file "
    path.write_bytes(bytes(data))


FORMATS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "csv": ("r.csv", lambda p: to_text(p, csv_of(motion()))),
    "upper case suffix": ("R.CSV", lambda p: to_text(p, csv_of(motion()))),
    "byte order mark": ("r.csv", lambda p: to_text(p, "\ufeff" + csv_of(motion()))),
    "windows line ends": ("r.csv", lambda p: p.write_bytes(csv_of(motion()).replace("\n", "\r\n").encode())),
    "utf-16": ("r.csv", lambda p: p.write_text(csv_of(motion()), encoding="utf-16")),
    "semicolons": ("r.csv", lambda p: to_text(p, csv_of(motion(), ";"))),
    "tabs": ("r.csv", lambda p: to_text(p, csv_of(motion(), "\t"))),
    "spaces": ("r.csv", lambda p: to_text(p, csv_of(motion(), "   "))),
    "comma and space": ("r.csv", lambda p: to_text(p, csv_of(motion(), ", "))),
    "decimal commas": ("r.csv", lambda p: to_text(p, csv_of(motion(), ";").replace(".", ","))),
    "quotes": ("r.csv", lambda p: to_text(p, quoted(csv_of(motion())))),
    "comments": ("r.csv", lambda p: to_text(p, "# rig 3\n\n" + csv_of(motion()).replace("\n0.1,", "\n# x\n0.1,"))),
    "header as a comment": ("r.csv", lambda p: to_text(p, "# " + csv_of(motion()))),
    "trailing commas": ("r.csv", lambda p: to_text(p, csv_of(motion()).replace("\n", ",\n"))),
    "csv.gz": ("r.csv.gz", lambda p: p.write_bytes(gzip.compress(csv_of(motion()).encode()))),
    "npz": ("r.npz", lambda p: np.savez(p, **motion())),
    "npz compressed": ("r.npz", lambda p: np.savez_compressed(p, **motion())),
    "npz columns": ("r.npz", lambda p: np.savez(p, **{k: v[:, None] for k, v in motion().items()})),
    "mat": ("r.mat", lambda p: scipy.io.savemat(p, motion())),
    "mat compressed": ("r.mat", lambda p: scipy.io.savemat(p, motion(), do_compression=True)),
    "mat version 4": ("r.mat", lambda p: scipy.io.savemat(p, motion(), format="4")),
    "mat 7.3": ("r.mat", to_mat73),
    "h5": ("r.h5", to_h5),
    "h5 in a group": ("r.hdf5", lambda p: to_h5(p, "/session/rig")),
}


@pytest.mark.parametrize("case", FORMATS)
def test_every_format_reads_to_the_same_numbers(tmp_path: Path, case: str) -> None:
    name, write = FORMATS[case]
    write(tmp_path / name)
    run = read(tmp_path, name).runs[0]
    expected = motion()
    np.testing.assert_array_equal(run.time_s, expected["time_s"])
    np.testing.assert_array_equal(run.torque_time_s, expected["time_s"])
    np.testing.assert_array_equal(run.torque_nm, expected["torque_nm"])
    np.testing.assert_array_equal(run.rate_rad_s, expected["rate_rad_s"])
    np.testing.assert_array_equal(run.angle_rad, expected["angle_rad"])
    assert run.valid.all()
    assert run.name == name


def only(folder: Path, options: str = "", entry: str = "", **columns: Any) -> Run:
    np.savez(folder / "r.npz", **columns)
    return read(folder, "r.npz", options, entry).runs[0]


def test_degrees_are_understood_by_name(tmp_path: Path) -> None:
    m = motion()
    run = only(
        tmp_path, time_s=m["time_s"], rate_deg_s=np.degrees(m["rate_rad_s"]), angle_deg=np.degrees(m["angle_rad"])
    )
    np.testing.assert_allclose(run.rate_rad_s, m["rate_rad_s"], rtol=1e-14)
    np.testing.assert_allclose(run.angle_rad, m["angle_rad"], rtol=1e-14)
    assert run.torque_nm is None and run.torque_time_s is None


def test_other_names_and_units_are_mapped(tmp_path: Path) -> None:
    m = motion()
    options = (
        "  columns: {time: T, torque: U, rate: W, angle: TH}\n"
        "  scale: {time: 0.001, torque: 35.15, rate: 0.0174532925199433, angle: -1}\n"
    )
    run = only(
        tmp_path,
        options,
        T=m["time_s"] * 1e3,
        U=m["torque_nm"],
        W=np.degrees(m["rate_rad_s"]),
        TH=-m["angle_rad"],
    )
    np.testing.assert_allclose(run.time_s, m["time_s"], rtol=1e-14)
    np.testing.assert_allclose(run.torque_nm, 35.15 * m["torque_nm"])
    np.testing.assert_allclose(run.rate_rad_s, m["rate_rad_s"])
    np.testing.assert_array_equal(run.angle_rad, m["angle_rad"])


def test_a_scale_that_is_given_replaces_the_one_in_the_name(tmp_path: Path) -> None:
    run = only(tmp_path, "  scale: {rate: 2}\n", time_s=motion()["time_s"], rate_deg_s=motion()["rate_rad_s"])
    np.testing.assert_array_equal(run.rate_rad_s, 2 * motion()["rate_rad_s"])


def test_a_lost_sample_may_hold_anything(tmp_path: Path) -> None:
    m = motion()
    valid = np.ones(500)
    valid[[7, 8]] = 0
    for name in ("rate_rad_s", "torque_nm", "angle_rad"):
        m[name] = m[name].copy()
        m[name][7] = np.nan
    m["time_s"] = m["time_s"].copy()
    m["time_s"][8] = np.nan
    run = only(tmp_path, valid=valid, **m)
    assert len(run.time_s) == 499  # without a time it is a missing row
    assert run.valid.sum() == 498
    assert run.torque_nm is not None and len(run.torque_nm) == 498 and np.isfinite(run.torque_nm).all()


def test_empty_fields_of_lost_samples_are_read_from_csv(tmp_path: Path) -> None:
    m = motion() | {"valid": np.ones(500)}
    lines = csv_of(m).splitlines()
    lines[6] = "0.005,,nan,,0"
    (tmp_path / "r.csv").write_text("\n".join(lines))
    run = read(tmp_path, "r.csv").runs[0]
    assert np.flatnonzero(~run.valid).tolist() == [5]


def test_text_in_a_column_that_is_not_used_does_no_harm(tmp_path: Path) -> None:
    lines = csv_of(motion()).splitlines()
    text = "\n".join([lines[0] + ",remark", *(line + ",fine" for line in lines[1:])])
    (tmp_path / "r.csv").write_text(text)
    np.testing.assert_array_equal(read(tmp_path, "r.csv").runs[0].rate_rad_s, motion()["rate_rad_s"])


def test_fields_of_a_matlab_struct_are_columns(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "r.mat", {"log": motion()})
    options = "  columns: {time: log.time_s, rate: log.rate_rad_s}\n"
    np.testing.assert_array_equal(read(tmp_path, "r.mat", options).runs[0].rate_rad_s, motion()["rate_rad_s"])


def test_same_names_in_two_groups_are_told_apart_by_their_path(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "r.h5", "w") as file:
        for group, factor in (("a", 1.0), ("b", 2.0)):
            file[f"{group}/time_s"] = motion()["time_s"]
            file[f"{group}/rate_rad_s"] = factor * motion()["rate_rad_s"]
    options = "  columns: {time: b/time_s, rate: b/rate_rad_s}\n"
    np.testing.assert_array_equal(read(tmp_path, "r.h5", options).runs[0].rate_rad_s, 2 * motion()["rate_rad_s"])


def test_the_raw_journal_of_a_cut_campaign_is_a_recording(tmp_path: Path) -> None:
    journal = Journal.create(tmp_path / "r.journal", {})
    journal.begin_run("2 Hz", {"frequency_hz": 2.0})
    m = motion()
    journal.append("samples", np.column_stack((m["time_s"], m["rate_rad_s"], np.ones(500))))
    journal.append("commands", np.column_stack((m["time_s"], m["torque_nm"], m["torque_nm"])))
    journal.flush()
    run = read(tmp_path, "r.journal").runs[0]
    journal.close()
    assert (run.name, run.frequency_hz) == ("2 Hz", 2.0)
    np.testing.assert_array_equal(run.torque_nm, m["torque_nm"])


def test_a_window_and_the_keys_of_a_run_are_honoured(tmp_path: Path) -> None:
    entry = (
        "      from_s: 0.1\n      to_s: 0.2\n      use: holdout\n"
        "      min_rate_rad_s: 0.3\n      added_inertia_kg_m2: 0.004\n    - {file: r.npz, use: fit, from_s: 0.3}\n"
    )
    np.savez(tmp_path / "r.npz", **motion())
    options = "  axis: linear\n  torque_hold: zero_order\n  noise: 0.002\n  min_rate_rad_s: 0.1\n"
    recording = read(tmp_path, "r.npz", options, entry)
    first, second = recording.runs
    assert (first.time_s[0], first.time_s[-1]) == (0.1, 0.2)
    assert first.torque_time_s is not None and first.torque_time_s[0] == 0.1
    assert (first.use, first.min_rate_rad_s, first.added_inertia_kg_m2) == ("holdout", 0.3, 0.004)
    assert (second.use, second.min_rate_rad_s, second.name) == ("fit", 0.1, "r.npz #2")
    assert (recording.axis, recording.noise, first.torque_hold) == ("linear", 0.002, "zero_order")


def test_a_file_outside_the_folder_of_the_yaml_may_be_read(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    np.savez(tmp_path / "r.npz", **motion())
    assert len(read(tmp_path / "inner", "../r.npz").runs[0].time_s) == 500
    assert len(read(tmp_path / "inner", str(tmp_path / "r.npz")).runs[0].time_s) == 500


def test_slow_samples_are_believed_where_the_time_scale_is_stated(tmp_path: Path) -> None:
    columns = {"time_s": np.arange(500.0), "rate_rad_s": np.sin(np.arange(500) / 9)}
    run = only(tmp_path, "  scale: {time: 1}\n", **columns)
    assert run.duration_s == 499.0


def test_slow_samples_are_believed_where_angle_and_rate_agree_about_them(tmp_path: Path) -> None:
    t = np.arange(500) * 0.5
    run = only(tmp_path, time_s=t, rate_rad_s=np.cos(0.2 * t), angle_rad=5 * np.sin(0.2 * t))
    assert run.duration_s == 249.5


def test_a_gyro_bias_and_noise_are_no_disagreement(tmp_path: Path) -> None:
    m = motion()
    random = np.random.default_rng(3)
    rate = m["rate_rad_s"] + 0.3 + 0.2 * random.normal(size=500)
    run = only(tmp_path, time_s=m["time_s"], rate_rad_s=rate, angle_rad=m["angle_rad"] + 1.7)
    assert run.rate_rad_s is not None and run.rate_rad_s[0] == rate[0]


def test_a_million_rows_of_csv_take_seconds(tmp_path: Path) -> None:
    t = np.arange(1_000_000) * 1e-3
    np.savetxt(
        tmp_path / "r.csv",
        np.column_stack((t, np.sin(t), np.cos(t))),
        delimiter=",",
        header="time_s,torque_nm,rate_rad_s",
        comments="",
        fmt="%.6f",
    )
    began = time.perf_counter()
    run = read(tmp_path, "r.csv").runs[0]
    assert time.perf_counter() - began < 15  # about 2 s on one idle core
    assert run.excerpt is not None and run.excerpt.samples == 1_000_000


def test_slow_libraries_are_loaded_only_for_their_own_formats() -> None:
    code = (
        "import sys, rig.config.load, rig.recording.load\n"
        "print([m for m in ('h5py', 'scipy.io', 'numba', 'serial', 'can', 'canopen') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[3]
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.skipif(not SHARED.exists(), reason="the real recordings are not beside this checkout")
@pytest.mark.parametrize(
    ("file", "options", "torque"),
    [
        ("lorenz_servo/run01.npz", "", True),
        ("lorenz_servo/run05.npz", "", True),
        ("emps/emps_train.npz", "  axis: linear\n  columns: {time: t_s, torque: force_N, angle: q_m}\n", True),
        ("pendulum_decay/pendulum_b.npz", "  columns: {time: t_s, angle: theta_rad}\n", False),
    ],
)
def test_real_recordings_are_accepted(tmp_path: Path, file: str, options: str, torque: bool) -> None:
    run = read(tmp_path, str(SHARED / file), options).runs[0]
    assert (run.torque_nm is not None) == torque
    assert run.valid.all() and len(run.time_s) > 10_000
