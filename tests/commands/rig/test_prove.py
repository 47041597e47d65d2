"""`rig prove`: what it plays and says, what it adds to a folder, and that it never takes anything away."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml

from commands.identify_run.app import app as identify_run
from commands.rig.app import app
from identify.report.report_data import FILE, image_of, read_report_data
from rig.config.load import check_config
from rig.errors import DeviceFault
from rig.interface import Exchange, GyroSample, Statement, Torque
from rig.recording.hdf5 import read_recording_h5, write_recording_h5
from sim_backend.simulated import SimulatedRig
from tests.commands.identification.proofs import PROOF, SETS, SPRUNG, TRUE, named, names, result, right, wrong
from tests.commands.identify_run.identifiers import Identifier, stand_in
from tests.commands.support import command, put_on_stage, write_config
from tests.rig.scripted import ScriptedRig


class RealRig(ScriptedRig):
    """Says that its torque is real."""

    def statement(self) -> Statement:
        return Statement(Torque.REAL, ("a scripted rig",))


@pytest.fixture(scope="module")
def identified(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign on the simulated rig in which the cubic spring was named."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        return campaign(tmp_path_factory.mktemp("identified"), monkeypatch)


@pytest.fixture
def folder(identified: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it, to add a proof to."""
    stand_in(monkeypatch, right())
    return shutil.copytree(identified, tmp_path / "out")


def campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, found: object = None) -> Path:
    stand_in(monkeypatch, found or right())  # type: ignore[arg-type]
    out = tmp_path / "out"
    done = command(identify_run, write_config(tmp_path, SPRUNG), "--out", out)
    assert done.exit_code == 0, done.output
    return out


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_right_name_is_confirmed_and_the_runs_are_added(folder: Path) -> None:
    before = {run.name: run for run in read_recording_h5(folder / "recording.h5").runs}
    journal = (folder / "recording.journal").read_bytes()
    done = command(app, "prove", folder)
    assert done.exit_code == 0, done.output
    proof = result(folder)["proof"]
    assert proof["status"] == "confirmed" and proof["effects"]["cubic_stiffness"]["status"] == "confirmed"
    assert proof["total"]["gone"] > 0.95
    assert names(folder) == SETS + PROOF
    for run in read_recording_h5(folder / "recording.h5").runs[:2]:
        np.testing.assert_array_equal(run.rate_rad_s, before[run.name].rate_rad_s)
    assert (folder / "recording.journal").read_bytes() == journal and (folder / "proof.journal").exists()
    assert "confirmed" in done.stdout and "cubic stiffness" in done.stderr
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert 'id="proof"' in page and "Measured against the linear model" in page


def test_the_report_can_be_made_again_with_its_proof(folder: Path) -> None:
    assert command(app, "prove", folder).exit_code == 0
    page = (folder / "report.html").read_bytes()
    assert command(app, "report", folder).exit_code == 0
    assert (folder / "report.html").read_bytes() == page


def test_a_refuted_name_is_excluded_and_the_search_runs_on_all_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = campaign(tmp_path, monkeypatch, wrong())
    identifier = stand_in(monkeypatch, right())
    done = command(app, "prove", folder)
    assert done.exit_code == 0, done.output
    ((recording, _, settings),) = identifier.given
    assert [run.name for run in recording.runs] == SETS + PROOF
    assert settings.candidates is not None and "quadratic_damping" not in settings.candidates
    assert "cubic_stiffness" in settings.candidates
    proof = result(folder)["proof"]
    assert proof["excluded"] == ["quadratic_damping"] and proof["effects"]["cubic_stiffness"]["status"] == "confirmed"
    assert sum("excluded; the search was repeated" in said for said in proof["sentences"]) == 1
    assert any("refuted" in said for said in proof["sentences"])
    second = [name.replace("proof", "proof 2", 1) for name in PROOF]
    assert names(folder) == SETS + PROOF + second and (folder / "proof_2.journal").exists()
    assert result(folder)["verdict"]["effects"] == ["cubic_stiffness"]


def test_a_second_proof_of_the_same_folder_is_added_too(folder: Path) -> None:
    assert command(app, "prove", folder).exit_code == 0
    first = (folder / "proof.journal").read_bytes()
    assert command(app, "prove", folder).exit_code == 0
    assert (folder / "proof.journal").read_bytes() == first and (folder / "proof_2.journal").exists()
    assert names(folder)[:6] == SETS + PROOF and len(names(folder)) == 10


def test_a_rival_is_played_too_and_the_worse_one_refuted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rival = replace(TRUE, effects={"quadratic_damping": {"factor": 0.05}})
    folder = campaign(tmp_path, monkeypatch, named(TRUE.effects, {"quadratic_damping": rival}))
    done = command(app, "prove", folder, "--rival", "quadratic_damping")
    assert done.exit_code == 0, done.output
    proof = result(folder)["proof"]
    assert proof["rivals"]["cubic_stiffness / quadratic_damping"]["status"] == "refuted"
    assert "proof: 5 Hz, quadratic_damping compensated" in names(folder)


def test_a_name_too_small_to_be_seen_does_not_take_the_zero_from_the_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = campaign(tmp_path, monkeypatch, named({**TRUE.effects, "torque_delay": {"delay": 1e-8}}))
    done = command(app, "prove", folder)
    assert done.exit_code == 0, done.output
    assert result(folder)["proof"]["effects"]["torque_delay"]["status"] == "cannot be told"
    assert "too small to be seen" in done.stderr and not any("torque_delay" in name for name in names(folder))


def test_an_unknown_rival_is_said_and_nothing_moves(folder: Path) -> None:
    before = contents(folder)
    done = command(app, "prove", folder, "--rival", "backlash")
    assert done.exit_code == 2 and "--rival backlash: this result has no such alternative" in done.stderr
    done = command(app, "prove", folder, "--rival", "unbalance")
    assert done.exit_code == 2 and "no proof tells it from cubic stiffness: within 15 deg" in done.stderr
    assert contents(folder) == before


@pytest.mark.parametrize("effects", [{}, {"sensor_lag": {"time": 1e-3}}])
def test_where_nothing_can_be_cancelled_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, effects: dict[str, dict[str, float]]
) -> None:
    folder = campaign(tmp_path, monkeypatch, named(effects))
    done = command(app, "prove", folder)
    assert done.exit_code == 2 and "has no effect that a torque cancels" in done.stderr
    assert "Traceback" not in done.output


@pytest.mark.parametrize(("gone", "said"), [("report_data.h5", "identify from"), ("recording.h5", "rig recover")])
def test_a_folder_that_lacks_something_is_refused_in_words(folder: Path, gone: str, said: str) -> None:
    (folder / gone).unlink()
    done = command(app, "prove", folder)
    assert done.exit_code == 2 and gone in done.stderr and said in done.stderr


def test_without_the_journals_nothing_is_added(folder: Path) -> None:
    (folder / "recording.journal").unlink()
    done = command(app, "prove", folder)
    assert done.exit_code == 2 and "holds no .journal" in done.stderr and names(folder) == SETS


def test_what_is_no_folder_is_said(tmp_path: Path) -> None:
    done = command(app, "prove", tmp_path / "gone")
    assert done.exit_code == 2 and "is not a folder" in done.stderr


def test_another_backend_than_that_of_the_recording_is_a_rehearsal(folder: Path) -> None:
    recording = read_recording_h5(folder / "recording.h5")
    (folder / "recording.h5").unlink()
    write_recording_h5(folder / "recording.h5", replace(recording, info=dict(recording.info) | {"played_on": "bench"}))
    before = contents(folder)
    done = command(app, "prove", folder, "--dry-run")
    assert done.exit_code == 0, done.output
    assert "A rehearsal" in done.stderr and "confirmed" in done.stdout
    assert names(folder / "rehearsal") == PROOF
    assert {k: v for k, v in contents(folder).items() if not k.startswith("rehearsal")} == before


def test_real_torque_without_yes_moves_nothing_and_changes_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, before = RealRig(), contents(folder)
    put_on_stage(monkeypatch, rig)
    done = command(app, "prove", folder)
    assert done.exit_code == 2 and "REAL torque" in done.stderr
    assert rig.log == [] and contents(folder) == before


class FailingRig(SimulatedRig):
    """The simulated rig until a moment; from then on its gyro reads too much, or its drive is silent."""

    def __init__(self, after_s: float, trips: bool) -> None:
        super().__init__(check_config(yaml.safe_load(SPRUNG) | {"name": "two"}, "test").simulated, 1000.0)
        self.after_s, self.trips, self.last_nm, self.log = after_s, trips, 0.0, list[str]()

    def exchange(self, now_s: float, torque_nm: float) -> Exchange:
        """As the simulated rig, until the moment."""
        self.last_nm = torque_nm
        seen = super().exchange(now_s, torque_nm)
        if now_s < self.after_s:
            return seen
        if not self.trips:
            raise DeviceFault("the drive fell silent")
        return Exchange((GyroSample(now_s, 9.0, True),), seen.torque, seen.channels)

    def torque_off(self) -> None:
        """Remembered."""
        self.last_nm = 0.0
        self.log.append("torque off")
        super().torque_off()

    def close(self) -> None:
        """Remembered."""
        self.log.append("close")
        super().close()


@pytest.mark.parametrize(("after_s", "whole"), [(0.9, 0), (8.0, 1)])
@pytest.mark.parametrize(("trips", "code"), [(True, 4), (False, 3)])
def test_what_cuts_a_proof_short_keeps_every_sample_and_the_results(
    folder: Path, monkeypatch: pytest.MonkeyPatch, after_s: float, whole: int, trips: bool, code: int
) -> None:
    rig, old = FailingRig(after_s, trips), result(folder)
    put_on_stage(monkeypatch, rig)
    done = command(app, "prove", folder)
    assert done.exit_code == code, done.output
    assert rig.last_nm == 0.0 and "torque off" in rig.log and rig.log[-1] == "close"
    assert names(folder) == SETS + PROOF[: whole + 1]
    assert len(read_recording_h5(folder / "recording.h5").runs[-1].time_s) > 100
    new = result(folder)
    assert new["aborted"] is True and new["after"] == old["after"] and new["verdict"] == old["verdict"]


def test_a_proof_that_is_cut_short_takes_nothing_from_the_verdict_of_an_earlier_one(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A verdict over all sets was replaced by one over the only set that was complete."""
    assert command(app, "prove", folder).exit_code == 0
    whole = result(folder)["proof"]
    put_on_stage(monkeypatch, FailingRig(8.0, trips=True))
    assert command(app, "prove", folder).exit_code == 4
    assert result(folder)["proof"] == whole and whole["status"] == "confirmed"
    assert len(names(folder)) > len([*SETS, *PROOF])  # what was recorded is kept even so


def test_after_a_proof_that_was_cut_short_another_can_be_played(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as failing:
        put_on_stage(failing, FailingRig(0.9, trips=True))
        assert command(app, "prove", folder).exit_code == 4
    first = (folder / "proof.journal").read_bytes()
    done = command(app, "prove", folder)
    assert done.exit_code == 0, done.output
    assert result(folder)["aborted"] is False and result(folder)["proof"]["status"] == "confirmed"
    assert (folder / "proof.journal").read_bytes() == first and (folder / "proof_2.journal").exists()
    assert names(folder) == [*SETS, PROOF[0], *(name.replace("proof", "proof 2", 1) for name in PROOF)]


def test_an_identification_that_was_stopped_is_not_proved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = campaign(tmp_path, monkeypatch)
    stored = read_report_data(folder / FILE)
    image = image_of(replace(stored, identification=replace(stored.identification, aborted=True)))
    assert image is not None
    (folder / FILE).write_bytes(image)
    done = command(app, "prove", folder)
    assert done.exit_code == 2 and "was stopped before its end: identify again" in done.stderr


def test_ctrl_c_while_the_search_runs_again_leaves_the_proof(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = campaign(tmp_path, monkeypatch, wrong())
    stand_in(monkeypatch, KeyboardInterrupt())
    done = command(app, "prove", folder)
    assert done.exit_code == 1, done.output
    assert result(folder)["proof"]["effects"]["quadratic_damping"]["status"] == "refuted"
    assert names(folder) == SETS + PROOF


def test_identification_is_not_run_again_where_all_is_confirmed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    identifier = Identifier(right())
    module = ModuleType("identify.pipeline")
    module.identify = identifier  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "identify.pipeline", module)
    assert command(app, "prove", folder).exit_code == 0
    assert identifier.given == []
