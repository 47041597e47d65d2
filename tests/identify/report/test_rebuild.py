"""`report.html` made again: the same bytes, or a plain sentence and the old report untouched."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from identify.conclude.plausibility import with_declared
from identify.report import report_data
from identify.report.files import write_results
from identify.report.rebuild import rebuild_report
from identify.report.report_data import read_report_data
from identify.residual import Dependence, Disturbance
from identify.results import (
    FollowUp,
    FollowUpPlan,
    FollowUpRound,
    Identification,
    Parting,
    Unparted,
)
from rig import effects
from rig.channels import Channel
from rig.effects import _channels, _outside
from rig.errors import UsageError
from rig.platform import Platform
from rig.recording.run import Recording
from tests.identify.sample import TRUTH, estimate, sample, unhappy
from tests.rig.effects.test_outside import EXAMPLE

DECLARED = Platform(0.0185, 0.06, 650.0)


def written(folder: Path, found: Identification | None = None, recording: Recording | None = None) -> bytes:
    """A results folder; returns its report."""
    write_results(folder, found or sample(2.0)[0], recording or sample(2.0)[1], DECLARED, "default")
    return (folder / "report.html").read_bytes()


def with_everything() -> Identification:
    """All that an identification may hold besides: a follow-up, a disturbance, rivals, a torque scale, odd numbers."""
    found = sample(2.0)[0]
    parting = Parting("coulomb_friction", "stribeck_friction", 900.0)
    plan = FollowUpPlan({"sets": [{"kind": "sine", "torque_nm": 5.0}]}, (parting,), 0.4, "A sine parts the two.")
    pair = (("coulomb_friction", "stribeck_friction"),)
    follow_up = FollowUp(
        plan, (Unparted("torque_delay", "sensor_lag", "both are late"),), (FollowUpRound(plan, pair, ()),), "played",
        found.before.error,
    )  # fmt: skip
    angle = Dependence("angle", 0.008, 0.0016, 1e-6, (-0.1, 0.0, 0.1), (0.01, -0.02, 0.01))
    verdict = replace(
        found.verdict, rival_models={"coulomb_friction": {"stribeck_friction": TRUTH}}, left_open="either of two things"
    )
    return replace(
        with_declared(found, {"inertia": 0.0203 * 57.3, "stiffness": 681.2 * 57.3}), follow_up=follow_up,
        disturbance=Disturbance(0.02, "N*m", 0.004, (angle,), {"damping": 2.0}), verdict=verdict,
        torque_scale=estimate(1.07, 0.001, ""), note="another error grew", scale_shows=True,
    )  # fmt: skip


def linear(recording: Recording) -> Recording:
    info = {"files": ("a.csv", "b.csv"), "numbers": {"x": 0.1, "y": None}}
    return replace(recording, axis="linear", noise=1e-3, info=info)


def aborted(found: Identification) -> Identification:
    return replace(found, after=None, residual_after=None, aborted=True, accepted=False)


KINDS: dict[str, Callable[[Identification, Recording], tuple[Identification, Recording]]] = {
    "accepted": lambda found, recording: (found, recording),
    "linear and unhappy": lambda _, recording: (unhappy(), linear(recording)),
    "aborted": lambda found, recording: (aborted(found), recording),
    "with everything": lambda _, recording: (with_everything(), recording),
    "without sets": lambda found, recording: (
        replace(found, joint=None, per_set=()), replace(recording, info={"backend": "<b>"})
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_the_report_is_the_same_to_the_byte(tmp_path: Path, kind: str) -> None:
    original = written(tmp_path, *KINDS[kind](*sample(2.0)))
    (tmp_path / "report.html").unlink()
    assert rebuild_report(tmp_path) == tmp_path / "report.html"
    assert (tmp_path / "report.html").read_bytes() == original
    assert not list(tmp_path.glob("*.part"))


def test_of_an_aborted_campaign_only_the_runs_that_were_identified_from_are_read(tmp_path: Path) -> None:
    found, whole = sample(2.0)
    (tmp_path / "folder").mkdir()
    written(tmp_path, found, whole)  # recording.h5 with all runs, as the campaign left it
    (tmp_path / "recording.h5").rename(tmp_path / "folder" / "recording.h5")
    cut = replace(whole, runs=whole.runs[:3])
    original = written(tmp_path / "folder", replace(found, aborted=True), cut)
    assert b"3 runs" in original
    rebuild_report(tmp_path / "folder")
    assert (tmp_path / "folder" / "report.html").read_bytes() == original


def test_effects_of_measured_channels_are_known_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found, recording = sample(2.0)
    heat = Channel("heat", "temperature", "K", 293.0, 1.0)
    monkeypatch.setattr(_channels, "_MADE", {})
    effects.declare_channels([heat])
    slope = effects.get("heat_stiffness").parameters[0].name
    model = replace(TRUTH, effects={"heat_stiffness": {slope: 0.5}}, channels={"heat": heat})
    found = replace(
        found, after=replace(found.final, platform=model), verdict=replace(found.verdict, effects=("heat_stiffness",))
    )
    warm = [replace(run, channels={"heat": 293.0 + run.time_s}, causes={"heat": heat}) for run in recording.runs]
    original = written(tmp_path, found, replace(recording, runs=tuple(warm)))
    assert b"heat stiffness" in original.lower()
    monkeypatch.setattr(_channels, "_MADE", {})
    assert "heat_stiffness" not in effects.known()
    rebuild_report(tmp_path)
    assert (tmp_path / "report.html").read_bytes() == original


def test_the_code_of_an_effect_of_your_own_is_run_only_when_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_outside, "_FILES", {})
    file = tmp_path / "my_effect.py"
    file.write_text(EXAMPLE, encoding="utf-8")
    effects.read_file(file)
    found, recording = sample(2.0)
    model = replace(TRUTH, effects={"eddy_brake": {"level": 1.0, "speed": 1.0}})
    found = replace(
        found, after=replace(found.final, platform=model), verdict=replace(found.verdict, effects=("eddy_brake",))
    )
    original = written(tmp_path, found, recording)
    monkeypatch.setattr(_outside, "_FILES", {})
    with pytest.raises(UsageError) as refused:
        rebuild_report(tmp_path)
    assert "effects of your own (eddy_brake)" in str(refused.value)
    assert f"--effects {file.resolve()}" in str(refused.value)
    rebuild_report(tmp_path, [file])
    assert (tmp_path / "report.html").read_bytes() == original


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def changed_number(path: Path) -> None:
    result = json.loads(path.read_text(encoding="utf-8"))
    result["after"]["parameters"]["inertia"]["value"] *= 1.01
    path.write_text(json.dumps(result), encoding="utf-8")


def of_version(version: int) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        with h5py.File(path, "r+") as file:
            file.attrs["version"] = version

    return change


def other_format(path: Path) -> None:
    path.unlink()
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "something else"


def with_field(old: str, new: str) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        with h5py.File(path, "r+") as file:
            text = file["identification"][()].decode()
            assert old in text
            del file["identification"]
            file["identification"] = text.replace(old, new)

    return change


def linked_array(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["arrays/000"]
        file["arrays/000"] = h5py.ExternalLink("/etc/hostname", "/")


def without_a_run(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["runs/001"]


FAULTS: dict[str, tuple[str, Callable[[Path], None], str]] = {
    "no result.json": ("result.json", Path.unlink, "has no result.json: nothing was identified in it"),
    "half a result.json": ("result.json", truncate, "is damaged"),
    "a list for a result": ("result.json", lambda p: void(p.write_text("[1]")), "holds list and no result"),
    "brackets without end": ("result.json", lambda p: void(p.write_text("[" * 200_000)), "is damaged"),
    "bytes that are no text": ("result.json", lambda p: void(p.write_bytes(b'{"a": "\xff"}')), "is damaged"),
    "a number changed by hand": ("result.json", changed_number, "do not hold the same numbers"),
    "a result of something else": ("result.json", lambda p: void(p.write_text("{}")), "do not hold the same numbers"),
    "a folder of before": ("report_data.h5", Path.unlink, "written by an earlier version"),
    "half the report data": ("report_data.h5", truncate, "is damaged"),
    "empty report data": ("report_data.h5", lambda p: void(p.write_bytes(b"")), "is damaged"),
    "another file": ("report_data.h5", other_format, "holds no report data"),
    "a later version": ("report_data.h5", of_version(2), "has version 2, this program reads version 1"),
    "a field that is gone": ("report_data.h5", with_field('"axis"', '"axes"'), "identification.axis is missing"),
    "a field of another kind": ("report_data.h5", with_field('"aborted": false', '"aborted": 0'), "aborted is 0"),
    "JSON that breaks off": ("report_data.h5", with_field('"axis"', '"axis'), "is damaged"),
    "a link out of the file": ("report_data.h5", linked_array, "is not kept in the file itself"),
    "no recording": ("recording.h5", Path.unlink, "has no recording.h5"),
    "half a recording": ("recording.h5", truncate, "is damaged"),
    "a recording that lacks a run": ("recording.h5", without_a_run, "has no run '1 Hz'"),
}  # fmt: skip


def void(_: object) -> None:
    """Of a change whose answer nobody needs."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A results folder, to be copied."""
    folder = tmp_path_factory.mktemp("results")
    written(folder)
    return folder


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_missing_or_damaged_is_said_and_the_old_report_stays(tmp_path: Path, results: Path, case: str) -> None:
    file, change, message = FAULTS[case]
    shutil.copytree(results, tmp_path, dirs_exist_ok=True)
    original = (tmp_path / "report.html").read_bytes()
    change(tmp_path / file)
    with pytest.raises(UsageError) as refused:
        rebuild_report(tmp_path)
    assert message.lower() in str(refused.value).lower()
    assert str(tmp_path) in str(refused.value)
    assert refused.value.exit_code == 2
    assert (tmp_path / "report.html").read_bytes() == original


def test_a_report_that_cannot_be_written_is_said(tmp_path: Path, results: Path) -> None:
    shutil.copytree(results, tmp_path, dirs_exist_ok=True)
    (tmp_path / "report.html").unlink()
    (tmp_path / "report.html").mkdir()
    with pytest.raises(UsageError, match=r"cannot write .*report\.html"):
        rebuild_report(tmp_path)
    assert not list(tmp_path.glob("*.part"))


def test_a_campaign_too_long_to_be_read_back_keeps_no_report_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report_data, "MAX_REPORT_VALUES", 1000)
    written(tmp_path)
    assert not (tmp_path / "report_data.h5").exists()
    with pytest.raises(UsageError, match="more samples than are kept"):
        rebuild_report(tmp_path)


def test_the_traces_are_kept_thinned_nowhere(results: Path) -> None:
    found = sample(2.0)[0]
    kept = read_report_data(results / "report_data.h5").identification
    for before, after in zip(found.traces, kept.traces, strict=True):
        assert np.array_equal(before.simulated_after, after.simulated_after)
        assert before.torque_residual_after is not None and after.torque_residual_after is not None
        assert np.array_equal(before.torque_residual_after, after.torque_residual_after)
