"""`rig recover` where the journal is lost: what the drivers make of the raw capture, or that nothing was played."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from commands.rig.app import app
from drivers.bench import BenchRig
from rig.config.load import load_config
from rig.recording.hdf5 import read_recording_h5
from rig.recording.journal import Journal
from rig.recording.load import read_recording
from tests.commands.support import command
from tests.drivers.wireless import played_in_two_sets, wireless_bench


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> BenchRig:
    return wireless_bench(monkeypatch, tmp_path)


@pytest.fixture
def only_raw(bench: BenchRig, tmp_path: Path) -> Path:
    """A results folder of which nothing but raw/wire.cap is left."""
    played_in_two_sets(bench)
    (tmp_path / "left" / "raw").mkdir(parents=True)
    shutil.copy(tmp_path / "raw" / "wire.cap", tmp_path / "left" / "raw")
    return tmp_path / "left"


def test_the_sets_are_recovered_from_the_capture_alone_and_can_be_identified(only_raw: Path) -> None:
    capture = (only_raw / "raw" / "wire.cap").read_bytes()
    done = command(app, "recover", only_raw)
    assert done.exit_code == 0, done.output
    assert "no journal holds a sample: the raw capture is decoded by the drivers instead" in done.stdout
    assert "the names of the sets were in the journal and are lost" in done.stdout
    runs = read_recording_h5(only_raw / "recording.h5").runs
    assert [run.name for run in runs] == ["set 1", "set 2"]
    assert all(f"{run.name}: {len(run.time_s)} samples" in done.stdout for run in runs)
    assert (only_raw / "raw" / "wire.cap").read_bytes() == capture
    loaded = load_config(only_raw / "recovered.yaml")
    assert "The declared model was lost" in loaded.text
    assert len(read_recording(loaded).runs) == 2


def test_a_follow_up_stands_behind_the_campaign_and_one_that_is_damaged_is_said(only_raw: Path) -> None:
    for name in ("follow_up", "follow_up_2"):
        (only_raw / "raw" / name).mkdir()
    shutil.copy(only_raw / "raw" / "wire.cap", only_raw / "raw" / "follow_up")
    (only_raw / "raw" / "follow_up_2" / "wire.cap").write_bytes(b"something else")
    (only_raw / "recording.h5").write_bytes(b"damaged")
    done = command(app, "recover", only_raw)
    assert done.exit_code == 0, done.output
    assert "raw/follow_up_2/wire.cap: no set could be recovered from it: is not a raw capture" in done.stdout
    runs = read_recording_h5(only_raw / "recovered.h5").runs
    assert [run.name for run in runs] == ["set 1", "set 2", "set 3", "set 4"]
    assert (only_raw / "recording.h5").read_bytes() == b"damaged"


def test_where_nothing_was_played_neither_journal_nor_capture_is_promised(bench: BenchRig, tmp_path: Path) -> None:
    with bench.opened():
        pass
    Journal.create(tmp_path / "recording.journal", {}).close()
    done = command(app, "recover", tmp_path)
    assert done.exit_code == 2
    assert "no journal with a sample in it" in done.stderr
    assert "raw/wire.cap: ends before the first set" in done.stderr
    assert "bench.replay" not in done.stderr
    assert not (tmp_path / "recording.h5").exists()
