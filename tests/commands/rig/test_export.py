"""What is exported is read back by our own readers to the last bit, and hostile names stay text."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from commands.rig.app import app
from rig.config.load import load_config
from rig.dynamics.torque import TorqueSignal
from rig.recording.hdf5 import read_recording_h5, write_recording_h5
from rig.recording.load import read_recording
from rig.recording.run import Recording, Run
from tests.commands.support import command, write_config

HOSTILE = ("=HYPERLINK(1)", "@x", "+1", "../../evil", "<script>alert(1)</script>", "a\nb,c", "\u202egnp", "file", "")


def held_run() -> Run:
    """Samples and torque on grids of their own, as on a bench; a lost sample and odd numbers among them."""
    time_s = np.arange(400) * 1e-3 + 1e-4 / 3
    rate = np.sin(37.0 * time_s) / 3.0
    valid = np.ones(400, dtype=bool)
    rate[7], valid[7] = math.nan, False
    torque_time_s = np.arange(0.0, 0.4, 0.00217)
    return Run(
        "held", time_s, valid, rate, torque_time_s=torque_time_s, torque_nm=np.cos(11.0 * torque_time_s) * 1e-7 / 7,
        torque_hold="zero_order", use="fit", min_rate_rad_s=0.01, added_inertia_kg_m2=0.125,
        channels={name: time_s * k for k, name in enumerate(HOSTILE)},
    )  # fmt: skip


def export(tmp_path: Path, run: Run, to: str) -> Path:
    write_recording_h5(tmp_path / "recording.h5", Recording((run,)))
    done = command(app, "export", tmp_path / "recording.h5", "--to", to, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    return tmp_path / "out"


@pytest.mark.parametrize("to", ["csv", "mat", "npz"])
def test_every_digit_survives(tmp_path: Path, to: str) -> None:
    run = held_run()
    run = Run(**{**vars(run), "channels": {}}) if to == "mat" else run
    back = read_recording(load_config(export(tmp_path, run, to) / "rig.yaml")).runs[0]
    here = np.isin(back.time_s, run.time_s)
    np.testing.assert_array_equal(back.time_s[here], run.time_s)
    np.testing.assert_array_equal(back.rate_rad_s[here], run.rate_rad_s)  # type: ignore[index]
    np.testing.assert_array_equal(back.valid[here], run.valid)
    assert not back.valid[~here].any()
    assert (back.torque_hold, back.use, back.min_rate_rad_s, back.added_inertia_kg_m2) == (
        "zero_order", "fit", 0.01, 0.125,
    )  # fmt: skip
    torque = TorqueSignal(back.torque_time_s, back.torque_nm, "zero_order")  # type: ignore[arg-type]
    fine_s = np.linspace(run.torque_time_s[0], run.torque_time_s[-1], 10_007)  # type: ignore[index]
    before = TorqueSignal(run.torque_time_s, run.torque_nm, "zero_order").at(fine_s)  # type: ignore[arg-type]
    np.testing.assert_array_equal(torque.at(fine_s), before)


def test_a_simulated_campaign_survives_as_it_is(tmp_path: Path) -> None:
    assert command(app, "play", write_config(tmp_path), "--quiet", "--out", tmp_path / "out").exit_code == 0
    done = command(app, "export", tmp_path / "out", "--to", "csv")
    assert done.exit_code == 0, done.output
    played = read_recording_h5(tmp_path / "out" / "recording.h5").runs
    back = read_recording(load_config(tmp_path / "out" / "export_csv" / "rig.yaml")).runs
    for one, other in zip(played, back, strict=True):
        here = np.isin(other.time_s, one.time_s)
        np.testing.assert_array_equal(other.rate_rad_s[here], one.rate_rad_s)  # type: ignore[index]
        there = np.isin(other.torque_time_s, one.torque_time_s)  # type: ignore[arg-type]
        np.testing.assert_array_equal(other.torque_nm[there], one.torque_nm)  # type: ignore[index]


def test_hostile_names_stay_text_and_inside_the_folder(tmp_path: Path) -> None:
    for number, name in enumerate(HOSTILE[:-1]):
        folder = tmp_path / str(number)
        folder.mkdir()
        run = Run(**{**vars(held_run()), "name": name})
        out = export(folder, run, "csv")
        assert {p.parent for p in out.rglob("*")} == {out}
        [file] = out.glob("*.csv")
        header, first = file.read_text(encoding="ascii").splitlines()[:2]
        assert all(re.fullmatch(r"[A-Za-z_]\w*", column) for column in header.split(","))
        assert all(cell == "" or math.isfinite(float(cell)) for cell in first.split(","))
        assert read_recording(load_config(out / "rig.yaml")).runs


def test_what_cannot_be_exported_is_said_and_leaves_no_folder(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time_s,rate_rad_s\n0,1\n1,2\n")
    write_recording_h5(tmp_path / "recording.h5", Recording((held_run(),)))
    for source, to, said in (
        ("recording.h5", "xlsx", "choose one of csv, mat, npz, blf, asc, mf4"),
        ("a.csv", "mat", "is already a table"),
        ("absent.h5", "csv", "no such file"),
        ("recording.h5", "blf", "only a bench run has a CAN log"),
    ):
        done = command(app, "export", tmp_path / source, "--to", to, "--out", tmp_path / "out")
        assert done.exit_code == 2 and said in done.stderr, done.output
        assert not (tmp_path / "out").exists()
    (tmp_path / "out").mkdir()
    done = command(app, "export", tmp_path / "recording.h5", "--to", "csv", "--out", tmp_path / "out")
    assert done.exit_code == 2 and "never overwritten" in done.stderr
