"""What a kill leaves is mended without a change to what is there, and a campaign goes on where it stopped."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from commands.identify_run.app import app as identify_run
from commands.rig.app import app
from rig.config.load import load_config
from rig.errors import DeviceFault
from rig.recording.hdf5 import read_recording_h5
from rig.recording.journal_reader import read_journal
from rig.recording.load import read_recording
from rig.recording.readers import read_file
from rig.recording.run import Run
from tests.commands.rig.test_play import after, breaking
from tests.commands.support import SECOND_SET_S, TWO_SETS, command, put_on_stage, write_config
from tests.rig.scripted import ScriptedRig

ARRAYS = ("time_s", "valid", "rate_rad_s", "torque_time_s", "torque_nm")


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of two sets that came to its end."""
    folder = tmp_path_factory.mktemp("played")
    done = command(app, "play", write_config(folder), "--quiet", "--out", folder / "out")
    assert done.exit_code == 0, done.output
    return folder / "out"


def killed(played: Path, folder: Path, keep: float = 0.8) -> Path:
    """The same campaign, killed when ``keep`` of its journal was written."""
    folder.mkdir()
    data = (played / "recording.journal").read_bytes()
    (folder / "recording.journal").write_bytes(data[: int(keep * len(data))])
    return folder


def contents(folder: Path) -> dict[str, str]:
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def assert_same(one: Run, other: Run) -> None:
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert list(one.channels) == list(other.channels)
    same = ("name", "use", "torque_hold", "frequency_hz", "rate_corner_hz", "rate_delay_s")
    assert [getattr(one, key) for key in same] == [getattr(other, key) for key in same]


def test_a_lost_export_is_made_again_bit_for_bit(played: Path, tmp_path: Path) -> None:
    folder = killed(played, tmp_path / "killed", keep=1.0)
    done = command(app, "recover", folder)
    assert done.exit_code == 0, done.output
    for one, other in zip(
        read_recording_h5(folder / "recording.h5").runs, read_recording_h5(played / "recording.h5").runs, strict=True
    ):
        assert_same(one, other)


def test_what_is_cut_is_said_and_what_is_there_is_exported(played: Path, tmp_path: Path) -> None:
    folder = killed(played, tmp_path / "killed")
    before = contents(folder)
    done = command(app, "recover", folder)
    assert done.exit_code == 0, done.output
    assert "result.json: missing" in done.stdout
    assert "the program was killed" in done.stdout and "7 Hz: CUT SHORT" in done.stdout
    runs = read_recording_h5(folder / "recording.h5").runs
    whole = read_recording_h5(played / "recording.h5").runs
    assert_same(runs[0], whole[0])
    np.testing.assert_array_equal(runs[1].rate_rad_s, whole[1].rate_rad_s[: len(runs[1].time_s)])  # type: ignore[index]
    assert before.items() <= contents(folder).items()  # nothing that was there is changed
    loaded = load_config(folder / "recovered.yaml")
    assert loaded.config.model.stiffness_nm_rad == 677.3
    assert len(read_recording(loaded).runs) == 2


def test_a_damaged_export_stays_and_another_is_written_beside_it(played: Path, tmp_path: Path) -> None:
    folder = killed(played, tmp_path / "killed")
    (folder / "recording.h5").write_bytes((played / "recording.h5").read_bytes()[:3000])
    (folder / "recording.h5.part").write_bytes(b"half")
    before = contents(folder)
    done = command(app, "recover", folder)
    assert done.exit_code == 0, done.output
    assert "recording.h5: damaged" in done.stdout and "recording.h5.part: incomplete" in done.stdout
    assert before.items() <= contents(folder).items()
    assert len(read_recording_h5(folder / "recovered.h5").runs) == 2
    assert len(read_file(folder)) == 2  # the folder itself can be named as a recording


def test_a_whole_folder_is_left_as_it_is(played: Path) -> None:
    before = contents(played)
    done = command(app, "recover", played)
    assert done.exit_code == 0 and "Nothing to recover" in done.stdout
    assert contents(played) == before


@pytest.mark.parametrize("text", [None, b"", b"nonsense" * 40, b"ISPJ" * 40])
def test_where_nothing_is_left_it_says_so(tmp_path: Path, text: bytes | None) -> None:
    if text is not None:
        (tmp_path / "recording.journal").write_bytes(text)
    done = command(app, "recover", tmp_path)
    assert done.exit_code == 2 and "nothing can be recovered" in done.stderr
    assert command(app, "recover", tmp_path / "absent").exit_code == 2


def test_code_that_a_recording_names_is_never_taken_over(played: Path, tmp_path: Path) -> None:
    from rig.recording.journal import Journal  # noqa: PLC0415

    header = {
        "config": {"model": {"inertia_kg_m2": 0.02, "effects_from": ["/elsewhere/evil.py"], "effects": {"evil": {}}}}
    }
    with Journal.create(tmp_path / "recording.journal", header) as journal:
        journal.begin_run("r", {})
        journal.append("samples", [(k * 1e-3, np.sin(k), 1.0) for k in range(50)])
        journal.append("commands", [(k * 1e-3, np.sin(k), 0.0) for k in range(50)])
    assert command(app, "recover", tmp_path).exit_code == 0
    text = (tmp_path / "recovered.yaml").read_text()
    assert "evil" not in text
    assert yaml.safe_load(text)["model"] == {"inertia_kg_m2": 0.02}


def test_only_the_sets_that_are_missing_are_played_and_all_are_joined(played: Path, tmp_path: Path) -> None:
    folder, out = killed(played, tmp_path / "killed"), tmp_path / "out"
    before = contents(folder)
    done = command(app, "play", write_config(tmp_path), "--resume", folder, "--out", out)
    assert done.exit_code == 0, done.output
    assert "1 of 2 sets finished; to play: 7 Hz" in done.stderr
    assert "5 Hz:" not in done.stderr  # the opening lists what will move
    assert contents(folder) == before
    runs = read_recording_h5(out / "recording.h5").runs
    assert [run.name for run in runs] == ["5 Hz", "7 Hz"]
    assert_same(runs[0], read_recording_h5(played / "recording.h5").runs[0])
    assert [r.name for r in read_journal(out / "recording.journal").runs] == ["7 Hz"]
    again = command(app, "play", write_config(tmp_path), "--quiet", "--resume", out, "--out", tmp_path / "again")
    assert again.exit_code == 0, again.output  # everything is finished: nothing moves, all is there
    assert len(read_recording_h5(tmp_path / "again" / "recording.h5").runs) == 2


def test_a_resumed_campaign_is_identified_from_all_its_sets(played: Path, tmp_path: Path) -> None:
    folder, out = killed(played, tmp_path / "killed"), tmp_path / "out"
    quick = (
        "--set",
        "identify.candidates=[]",
        "--set",
        "identify.genetic={population: 4, generations: 1, restarts: 0}",
    )
    done = command(identify_run, write_config(tmp_path), "--quiet", "--resume", folder, "--out", out, *quick)
    assert done.exit_code in (0, 1), done.output
    result = json.loads((out / "result.json").read_text())
    assert [row["frequency_hz"] for row in result["per_set"]] == [5.0, 7.0]
    assert (out / "report.html").exists() and not (folder / "result.json").exists()


def test_a_resumed_campaign_that_is_cut_again_is_resumed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = TWO_SETS + "    - {torque_nm: 20, frequency_hz: 9, duration_s: 0.4}\n"
    config = write_config(tmp_path, text)
    for part in ("a", "b"):  # each time the drive falls silent in the second set that is played
        put_on_stage(monkeypatch, ScriptedRig(after(SECOND_SET_S, breaking(DeviceFault("silent")))))
        resume = () if part == "a" else ("--resume", tmp_path / "a")
        done = command(app, "play", config, "--quiet", "--out", tmp_path / part, *resume)
        assert done.exit_code == 3, done.output
    put_on_stage(monkeypatch, ScriptedRig())
    done = command(app, "play", config, "--resume", tmp_path / "b", "--out", tmp_path / "c")
    assert done.exit_code == 0, done.output
    assert "2 of 3 sets finished; to play: 9 Hz" in done.stderr
    recording = read_recording_h5(tmp_path / "c" / "recording.h5")
    assert [run.name for run in recording.runs] == ["5 Hz", "7 Hz", "9 Hz"]
    assert recording.info["resumed_from"] == str(tmp_path / "b")
    assert sorted(p.name for p in (tmp_path / "c").glob("earlier*")) == ["earlier_1.journal", "earlier_2.journal"]


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("excitation.sets.1.torque_nm=10", "excitation.sets.1.torque_nm: was 20.0, is 10.0"),
        ("excitation.sample_rate_hz=500", "excitation.sample_rate_hz: was 1000.0, is 500.0"),
        ("simulated.gyro.noise_deg_s=0.1", "simulated.gyro.noise_deg_s: was 0.05, is 0.1"),
        ("simulated.platform.inertia_kg_m2=0.03", "simulated.platform.inertia_kg_m2"),
    ],
)
def test_what_would_not_belong_together_is_refused_by_its_key(
    played: Path, tmp_path: Path, override: str, said: str
) -> None:
    folder, out = killed(played, tmp_path / "killed"), tmp_path / "out"
    done = command(app, "play", write_config(tmp_path), "--resume", folder, "--out", out, "--set", override)
    assert done.exit_code == 2
    assert said in done.stderr and not out.exists()


@pytest.mark.parametrize(
    "override", ["identify.seed=7", "limits.travel_deg=9", "excitation.rest_s=0.4", "simulated.seed=9", "name=other"]
)
def test_what_does_not_matter_may_differ(played: Path, tmp_path: Path, override: str) -> None:
    folder = killed(played, tmp_path / "killed")
    line = ("play", write_config(tmp_path), "--quiet", "--resume", folder, "--out", tmp_path / "o", "--set", override)
    done = command(app, *line)
    assert done.exit_code == 0, done.output


def test_what_cannot_be_resumed_is_said(tmp_path: Path) -> None:
    config, recorded = write_config(tmp_path), tmp_path / "recorded.yaml"
    recorded.write_text("backend: recorded\nrecorded: {runs: [{file: a.csv}]}\n")
    for line, said in (
        ((config, "--resume", tmp_path / "absent"), "is not a folder"),
        ((config, "--resume", tmp_path), "play the campaign again"),
        ((recorded, "--resume", tmp_path), "nothing to resume"),
    ):
        done = command(identify_run, *line, "--out", tmp_path / "out")
        assert done.exit_code == 2 and said in done.stderr, done.output


def test_the_raw_of_an_interrupted_campaign_is_identified_from(played: Path, tmp_path: Path) -> None:
    folder = killed(played, tmp_path / "killed", keep=0.55)  # the second set has just begun
    config = tmp_path / "raw.yaml"
    config.write_text(f"backend: recorded\nrecorded: {{runs: [{{file: {folder}/recording.journal}}]}}\n")
    recording = read_recording(load_config(config))
    assert recording.runs[0].name == "5 Hz" and recording.runs[0].torque_nm is not None
    config.write_text(f"backend: recorded\nrecorded: {{runs: [{{file: {folder}}}]}}\n")
    other = read_recording(load_config(config))
    assert dataclasses.asdict(other)["runs"][0]["name"] == "5 Hz"
    assert len(other.runs) == len(recording.runs)
