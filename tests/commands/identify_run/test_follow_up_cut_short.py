"""A follow-up that is refused or cut short: the results without it stand, and every sample is kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from commands.identify_run.app import app
from rig.errors import DeviceFault
from rig.interface import Exchange, GyroSample, TorqueSample
from tests.commands.identify_run.follow_ups import AUTO, FIRST_S, Stub, doubtful, names, plan_of, result
from tests.commands.support import command, put_on_stage, write_config
from tests.rig.scripted import ScriptedRig


def test_a_trip_in_the_follow_up_keeps_the_first_results_and_every_sample(
    tmp_path: Path, stub: Stub, monkeypatch: pytest.MonkeyPatch
) -> None:
    plays = 0

    def count() -> None:
        nonlocal plays
        plays += 1

    def too_fast(now_s: float) -> Exchange | None:
        if plays and now_s > FIRST_S + 0.7:
            return Exchange((GyroSample(now_s, 9.0, True),), (TorqueSample(now_s, 1.0),))
        return None

    rig = ScriptedRig(lambda now_s: too_fast(now_s + FIRST_S * plays), on_disarm=count)
    put_on_stage(monkeypatch, rig)
    identifier, out = stub(doubtful()), tmp_path / "out"
    done = command(app, write_config(tmp_path), *AUTO, "--out", out)
    assert done.exit_code == 4, done.output
    assert rig.torque_nm == 0.0
    assert len(identifier.given) == 1
    content = result(out)
    assert content["verdict"]["effects"] == ["coulomb_friction", "torque_delay"] and content["aborted"] is True
    assert content["follow_up"]["played"] is False and "cut short" in content["follow_up"]["note"]
    assert names(out) == ["5 Hz", "7 Hz", "follow-up: 11 Hz"]


def test_a_fault_in_the_follow_up_ends_in_3(tmp_path: Path, stub: Stub, monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(now_s: float) -> None:
        if rig.log.count("open") == 2 and now_s > 0.7:
            raise DeviceFault("the drive fell silent")

    rig = ScriptedRig(silent)
    put_on_stage(monkeypatch, rig)
    stub(doubtful())
    done = command(app, write_config(tmp_path), *AUTO, "--out", tmp_path / "out")
    assert done.exit_code == 3, done.output
    assert "the drive fell silent" in done.stderr
    assert result(tmp_path / "out")["after"] is not None


def test_one_that_the_preflight_refuses_is_not_played_and_nothing_is_lost(tmp_path: Path, stub: Stub) -> None:
    identifier = stub(doubtful(), plans=(plan_of(torque_nm=349.0),))
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), *AUTO, "--out", out)
    assert done.exit_code == 0, done.output
    assert len(identifier.given) == 1
    assert "nothing was moved" in result(out)["follow_up"]["note"]
    assert names(out) == ["5 Hz", "7 Hz"] and not (out / "follow_up.journal").exists()


@pytest.mark.parametrize(("error", "code"), [(KeyboardInterrupt(), 130), (DeviceFault("no emulators"), 3)])
def test_what_ends_a_follow_up_before_it_begins_leaves_the_first_results(
    tmp_path: Path, stub: Stub, monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int
) -> None:
    stub(doubtful())

    def fail(*_: Any) -> None:
        raise error

    monkeypatch.setattr("commands.campaign.follow_up.play", fail)
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), *AUTO, "--out", out)
    assert done.exit_code == code, done.output
    assert result(out)["aborted"] is True and "was not played" in result(out)["follow_up"]["note"]
    assert names(out) == ["5 Hz", "7 Hz"]


def test_ctrl_c_while_all_the_data_are_identified_leaves_the_first_results(tmp_path: Path, stub: Stub) -> None:
    stub(doubtful(), KeyboardInterrupt())
    out = tmp_path / "out"
    assert command(app, write_config(tmp_path), *AUTO, "--out", out).exit_code == 130
    content = result(out)
    assert content["aborted"] is True and content["verdict"]["effects"] == ["coulomb_friction", "torque_delay"]
    assert names(out) == ["5 Hz", "7 Hz", "follow-up: 11 Hz"]
