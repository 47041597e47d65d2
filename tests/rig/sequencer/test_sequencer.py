"""The sequencer plays on time, keeps what it has, and takes the torque off on every way out."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from rig.clock import Clock, MonotonicClock, VirtualClock
from rig.config.limits import LimitsConfig
from rig.errors import Aborted, DeviceFault, SafetyTrip
from rig.excitation import ExcitationSet, PlannedSet, Sine, planned
from rig.guard import Guard
from rig.interface import Exchange, GyroSample, TorqueSample
from rig.recording.journal import Journal
from rig.recording.journal_reader import read_journal, recording_from_journal
from rig.sequencer import SETTLE_S, Observer, Progress, Sequencer
from rig.sequencer.recorder import SetStatistics
from tests.rig.scripted import ScriptedRig

ONE = Sine(torque_nm=10, frequency_hz=5, duration_s=0.5)
TWO = (ONE, Sine(torque_nm=20, frequency_hz=7, duration_s=0.3))
LIMITS = LimitsConfig()


def sequencer(
    rig: ScriptedRig,
    clock: Clock | None = None,
    journal: Journal | None = None,
    observer: Observer | None = None,
    stop: Callable[[], str | None] = lambda: None,
) -> Sequencer:
    return Sequencer(
        rig,
        clock or VirtualClock(),
        Guard(LIMITS),
        sample_rate_hz=1000,
        rest_s=0.2,
        journal=journal,
        observer=observer,
        stop=stop,
    )


def plan(sets: Sequence[ExcitationSet] = (ONE,)) -> tuple[PlannedSet, ...]:
    return planned(sets)


def raising(error: BaseException, at_s: float) -> Callable[[float], Exchange | None]:
    def on_exchange(now_s: float) -> Exchange | None:
        if now_s >= at_s:
            raise error
        return None

    return on_exchange


def test_a_campaign_opens_arms_plays_disarms_and_closes_in_that_order() -> None:
    rig = ScriptedRig()
    campaign = sequencer(rig).play(plan(TWO))
    assert rig.log == ["open", "arm", "disarm", "close"]
    assert not campaign.aborted
    assert [r.name for r in campaign.recording.runs] == ["5 Hz", "7 Hz"]
    assert all(s.complete for s in campaign.statistics)


def test_the_record_runs_from_zero_to_the_length_of_the_set_with_the_torque_that_was_sent() -> None:
    run = sequencer(ScriptedRig()).play(plan()).recording.runs[0]
    assert run.torque_time_s is not None and run.torque_nm is not None
    np.testing.assert_allclose(run.time_s, np.arange(501) / 1000, atol=1e-9)
    np.testing.assert_allclose(run.torque_nm, ONE.torque(run.torque_time_s), atol=1e-6)
    assert (run.torque_hold, run.frequency_hz) == ("zero_order", 5)


def test_torque_is_zero_before_between_and_after_the_sets() -> None:
    rig = ScriptedRig()
    sequencer(rig).play(plan(TWO))
    at = np.array(rig.sent)
    first = SETTLE_S + 0.001
    second = first + 0.5 + 0.05 + 0.2 + 0.001
    inside = ((at[:, 0] > first) & (at[:, 0] < first + 0.5)) | (at[:, 0] > second)
    assert not at[~inside, 1].any()
    assert at[-1, 1] == 0.0
    assert np.abs(at[inside, 1]).max() > 19


def test_torque_follows_the_time_and_not_the_number_of_the_tick() -> None:
    rig = ScriptedRig()
    clock = VirtualClock(late_s=lambda d: 0.0034 if 0.6005 < d < 0.6015 else 2e-4)
    campaign = sequencer(rig, clock).play(plan())
    start = SETTLE_S + 2e-4 + 1e-3
    sent = [(t - start, u) for t, u in rig.sent if 0 <= t - start < 0.5]
    np.testing.assert_allclose([u for _, u in sent], ONE.torque(np.array([t for t, _ in sent])), atol=1e-9)
    assert len(sent) < 500
    assert campaign.statistics[0].missed_ticks == 3
    assert campaign.statistics[0].late.max_s == pytest.approx(0.0034)


def test_a_late_tick_is_never_made_up_for_by_a_burst() -> None:
    rig = ScriptedRig()
    clock = VirtualClock(late_s=lambda d: 0.0104 if abs(d - 0.601) < 1e-9 else 0.0)
    sequencer(rig, clock).play(plan())
    spacing = np.diff([t for t, _ in rig.sent])
    assert spacing.min() > 5e-4


def test_a_stall_trips_and_nothing_is_sent_after_it() -> None:
    rig = ScriptedRig()
    clock = VirtualClock(late_s=lambda d: 0.06 if abs(d - 0.701) < 1e-9 else 0.0)
    campaign = sequencer(rig, clock).play(plan(TWO))
    assert isinstance(campaign.cause, SafetyTrip)
    assert "stall or clock jump" in str(campaign.cause)
    assert rig.sent[-1][0] < 0.701
    assert rig.log[2:] == ["torque off", "torque off", "disarm", "close"]


def test_a_trip_takes_the_torque_off_and_keeps_what_was_recorded() -> None:
    def fast(now_s: float) -> Exchange | None:
        return Exchange((GyroSample(now_s, math.radians(500), True),), ()) if now_s > 0.6995 else None

    rig = ScriptedRig(fast)
    campaign = sequencer(rig).play(plan(TWO))
    assert isinstance(campaign.cause, SafetyTrip)
    assert "rate (limits.rate_deg_s): 500 deg/s at 0.199 s, allowed is 400 deg/s" in str(campaign.cause)
    assert rig.torque_nm == 0.0
    assert rig.log[2] == "torque off"
    assert rig.log[-2:] == ["disarm", "close"]
    run = campaign.recording.runs[0]
    assert run.duration_s == pytest.approx(0.2, abs=2e-3)
    assert not campaign.statistics[0].complete
    assert campaign.recording.info["aborted"] == str(campaign.cause)


def test_a_device_fault_ends_the_campaign_with_the_data_kept() -> None:
    rig = ScriptedRig(raising(DeviceFault("gyro unplugged"), 0.8))
    campaign = sequencer(rig).play(plan())
    assert isinstance(campaign.cause, DeviceFault)
    assert len(campaign.recording.runs[0].time_s) > 250
    assert rig.torque_nm == 0.0
    assert rig.log[-2:] == ["disarm", "close"]


def test_ctrl_c_is_an_abort_with_the_data_kept() -> None:
    rig = ScriptedRig(raising(KeyboardInterrupt(), 0.8))
    campaign = sequencer(rig).play(plan())
    assert isinstance(campaign.cause, Aborted)
    assert campaign.cause.exit_code == 130
    assert len(campaign.recording.runs) == 1
    assert rig.log[2:] == ["torque off", "disarm", "close"]


def test_any_other_exception_passes_through_with_the_torque_off() -> None:
    rig = ScriptedRig(raising(ZeroDivisionError("a mistake of ours"), 0.8))
    with pytest.raises(ZeroDivisionError):
        sequencer(rig).play(plan())
    assert rig.torque_nm == 0.0
    assert rig.log[2:] == ["torque off", "disarm", "close"]
    assert gc.isenabled()


def test_a_request_to_stop_is_heard_at_the_next_tick() -> None:
    rig = ScriptedRig()
    campaign = sequencer(rig, stop=lambda: "SIGTERM" if len(rig.sent) == 300 else None).play(plan())
    assert isinstance(campaign.cause, Aborted)
    assert str(campaign.cause).startswith("SIGTERM: torque is off")
    assert len(rig.sent) == 300


def test_a_drive_that_cannot_be_shown_to_be_off_is_said_beside_what_came_before() -> None:
    def stuck() -> None:
        raise DeviceFault("the drive does not answer: cut its power.")

    rig = ScriptedRig(raising(SafetyTrip("travel"), 0.8), stuck)
    cause = sequencer(rig).play(plan()).cause
    assert isinstance(cause, DeviceFault)
    assert "cut its power" in str(cause) and "travel" in str(cause)
    assert rig.log[-1] == "close"


def test_a_rig_that_cannot_be_armed_is_closed_again() -> None:
    class Unarmed(ScriptedRig):
        def arm(self) -> None:
            raise DeviceFault("no heartbeat")

    rig = Unarmed()
    campaign = sequencer(rig).play(plan())
    assert isinstance(campaign.cause, DeviceFault)
    assert rig.log == ["open", "disarm", "close"]
    assert not campaign.recording.runs


def test_samples_that_arrive_late_land_where_their_time_stamp_says() -> None:
    def delayed(now_s: float) -> Exchange:
        true_at_s = now_s - 0.012
        gyro = GyroSample(true_at_s, 1e-3 * math.sin(99 * true_at_s), True)
        return Exchange((gyro,), (TorqueSample(now_s, 0.0),))

    run = sequencer(ScriptedRig(delayed)).play(plan()).recording.runs[0]
    assert run.rate_rad_s is not None
    np.testing.assert_allclose(run.time_s, np.arange(501) / 1000, atol=1e-9)
    start_s = SETTLE_S + 0.001
    np.testing.assert_allclose(run.rate_rad_s, 1e-3 * np.sin(99 * (run.time_s + start_s)), atol=1e-9)


def test_a_set_of_which_no_torque_was_ever_reported_is_no_run() -> None:
    def mute(now_s: float) -> Exchange:
        return Exchange((GyroSample(now_s, 1e-3 * math.sin(99 * now_s), True),), ())

    assert sequencer(ScriptedRig(mute)).play(plan()).recording.runs == ()


def test_channels_are_kept_at_the_instants_of_the_samples() -> None:
    def with_encoder(now_s: float) -> Exchange:
        gyro = GyroSample(now_s, 1e-3 * math.sin(1e4 * now_s), True)
        return Exchange((gyro,), (TorqueSample(now_s, 0.0),), {"angle_rad": 0.1 * now_s})

    run = sequencer(ScriptedRig(with_encoder)).play(plan()).recording.runs[0]
    slope = np.diff(run.channels["angle_rad"]) / np.diff(run.time_s)
    np.testing.assert_allclose(slope, 0.1, rtol=1e-6)


def test_the_journal_holds_the_same_samples_as_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "raw.journal"
    with Journal.create(path, {"axis": "rotary"}) as journal:
        played = sequencer(ScriptedRig(), journal=journal).play(plan(TWO)).recording
    again = recording_from_journal(read_journal(path))
    assert [r.name for r in again.runs] == [r.name for r in played.runs]
    for a, b in zip(again.runs, played.runs, strict=True):
        assert a.rate_rad_s is not None and b.rate_rad_s is not None
        assert a.torque_nm is not None and b.torque_nm is not None
        np.testing.assert_array_equal(a.time_s, b.time_s)
        np.testing.assert_array_equal(a.rate_rad_s, b.rate_rad_s)
        np.testing.assert_array_equal(a.torque_nm, b.torque_nm)
        assert (a.torque_hold, a.frequency_hz, a.use) == (b.torque_hold, b.frequency_hz, b.use)


def test_the_journal_of_a_campaign_that_tripped_has_all_samples_and_the_reason(tmp_path: Path) -> None:
    path = tmp_path / "raw.journal"
    rig = ScriptedRig(raising(SafetyTrip("a limit"), 0.8))
    with Journal.create(path, {}) as journal:
        played = sequencer(rig, journal=journal).play(plan()).recording
    contents = read_journal(path)
    assert len(recording_from_journal(contents).runs[0].time_s) == len(played.runs[0].time_s)
    assert any("a limit" in str(event) for event in contents.events)


def test_the_observer_hears_the_beginning_the_progress_and_the_end_of_each_set() -> None:
    class Listener(Observer):
        heard: list[str] = []  # noqa: RUF012

        def set_begins(self, planned: PlannedSet, number: int, count: int) -> None:
            self.heard.append(f"begin {number}/{count}")

        def progress(self, progress: Progress) -> None:
            self.heard.append(f"at {progress.time_s:.1f} of {progress.duration_s}")

        def set_ends(self, statistics: SetStatistics) -> None:
            self.heard.append(f"peak {statistics.peak_torque_nm:.1f}")

    listener = Listener()
    sequencer(ScriptedRig(), observer=listener).play(plan())
    assert listener.heard[0] == "begin 1/1"
    assert listener.heard[1:4] == ["at 0.0 of 0.5", "at 0.1 of 0.5", "at 0.2 of 0.5"]
    assert listener.heard[-1] == "peak 10.0"


def test_the_same_loop_runs_against_the_clock_on_the_wall() -> None:
    short = Sine(torque_nm=10, frequency_hz=20, duration_s=0.05)
    clock = MonotonicClock()
    before = clock.now_s()
    campaign = sequencer(ScriptedRig(), clock).play(plan((short,)))
    if campaign.cause is None:  # a machine under load may stall, and that is then a trip
        assert clock.now_s() - before >= SETTLE_S + 0.05
        assert campaign.recording.runs[0].duration_s == pytest.approx(0.05, abs=0.01)
    else:
        assert isinstance(campaign.cause, SafetyTrip)


@pytest.mark.parametrize(("also", "count"), [("the adapter has vanished", 1), ("the drive does not answer", 2)])
def test_two_faults_on_the_way_out_are_both_told_and_the_same_one_once(also: str, count: int) -> None:
    def fail() -> None:
        raise DeviceFault(f"the drive could not be shown to be off: {also}")

    rig = ScriptedRig(raising(DeviceFault("the adapter has vanished"), 0.8), fail)
    told = str(sequencer(rig).play(plan()).cause)
    assert told.count("vanished") == 1
    assert told.count("the drive could not be shown to be off") == 1
    assert ("while handling" in told) is (count == 2)
