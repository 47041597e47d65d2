"""The better times that a rig knows after a campaign, in memory and in the journal alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from rig.clock import VirtualClock
from rig.config.limits import LimitsConfig
from rig.errors import SafetyTrip
from rig.excitation import Sine, planned
from rig.guard import Guard
from rig.interface import Correction, Exchange, GyroSample, TorqueOfTime, TorqueSample
from rig.recording.journal import Journal, JournalError
from rig.recording.journal_reader import read_journal, recording_from_journal
from rig.sequencer import Campaign, Sequencer
from tests.rig.scripted import ScriptedRig

SETS = planned((Sine(torque_nm=10, frequency_hz=5, duration_s=0.5), Sine(torque_nm=20, frequency_hz=7, duration_s=0.3)))
EARLY_S, LATE_S = 2e-4, 3e-4


class KnowsBetter(ScriptedRig):
    """Its samples were stamped too early, by more and more; its torques too late."""

    def __init__(self, on_exchange: Callable[[float], Exchange | None] = lambda now_s: None) -> None:
        super().__init__(on_exchange)
        self.starts: list[float] = []

    def begin_set(self, torque: TorqueOfTime, start_s: float) -> None:
        self.starts.append(start_s)

    def corrections(self) -> Sequence[Correction]:
        self.log.append("corrections")
        return [
            Correction(s, ((s, s + 0.5), (s, s + 0.5 + EARLY_S)), ((s - 1, s + 1), (s - 1 - LATE_S, s + 1 - LATE_S)))
            for s in self.starts
        ]


def played(rig: ScriptedRig, journal: Journal | None = None) -> Campaign:
    return Sequencer(
        rig, VirtualClock(), Guard(LimitsConfig()), sample_rate_hz=1000, rest_s=0.2, journal=journal
    ).play(SETS)  # fmt: skip


def with_encoder(now_s: float) -> Exchange:
    gyro = GyroSample(now_s, 1e-3 * np.sin(1e4 * now_s), True)
    return Exchange((gyro,), (TorqueSample(now_s, 0.0),), {"angle_rad": 0.1 * now_s})


def test_they_are_asked_for_when_the_torque_is_off_and_the_devices_are_let_go() -> None:
    rig = KnowsBetter()
    played(rig)
    assert rig.log == ["open", "arm", "disarm", "close", "corrections"]


def test_samples_torques_and_channels_stand_at_the_better_times() -> None:
    plain, better = (played(kind(with_encoder)).recording.runs for kind in (ScriptedRig, KnowsBetter))
    for a, b in zip(plain, better, strict=True):
        assert a.torque_time_s is not None and b.torque_time_s is not None
        np.testing.assert_allclose(b.time_s - a.time_s, EARLY_S * a.time_s / 0.5, atol=1e-9)
        np.testing.assert_allclose(b.torque_time_s - a.torque_time_s, -LATE_S, atol=1e-9)
        inside = b.time_s < a.time_s[-1]
        slope = np.diff(b.channels["angle_rad"][inside]) / np.diff(b.time_s[inside])
        np.testing.assert_allclose(slope, 0.1, rtol=1e-6)


@pytest.mark.parametrize("trips", [False, True])
def test_the_journal_gives_bit_for_bit_what_is_in_memory(tmp_path: Path, trips: bool) -> None:
    def on_exchange(now_s: float) -> Exchange | None:
        if trips and now_s > 0.8:
            raise SafetyTrip("a limit")
        return with_encoder(now_s)

    with Journal.create(tmp_path / "a.journal", {}) as journal:
        campaign = played(KnowsBetter(on_exchange), journal)
    assert campaign.aborted is trips
    again = recording_from_journal(read_journal(tmp_path / "a.journal")).runs
    assert len(again) == (1 if trips else 2)
    for a, b in zip(campaign.recording.runs, again, strict=True):
        assert a.torque_time_s is not None and b.torque_time_s is not None
        np.testing.assert_array_equal(a.time_s, b.time_s)
        np.testing.assert_array_equal(a.torque_time_s, b.torque_time_s)
        np.testing.assert_array_equal(a.channels["angle_rad"], b.channels["angle_rad"])
        assert a.time_s[-1] != pytest.approx(round(a.time_s[-1], 3), abs=1e-6), "they were moved"


def test_a_rig_that_fails_over_it_costs_no_sample_and_it_is_said(tmp_path: Path) -> None:
    rig = KnowsBetter()
    rig.corrections = lambda: 1 / 0  # type: ignore[method-assign,assignment,return-value]
    with Journal.create(tmp_path / "a.journal", {}) as journal:
        campaign = played(rig, journal)
    assert campaign.cause is None
    assert len(campaign.recording.runs) == 2
    assert any("could not be corrected" in event.text for event in read_journal(tmp_path / "a.journal").events)


def test_a_map_that_turns_time_around_is_refused_as_a_whole() -> None:
    rig = KnowsBetter()
    rig.corrections = lambda: [Correction(rig.starts[0], ((0.0, 1.0), (1.0, 0.0)), ((), ()))]  # type: ignore[method-assign]
    plain = played(ScriptedRig()).recording.runs[0]
    np.testing.assert_array_equal(played(rig).recording.runs[0].time_s, plain.time_s)


def test_a_journal_that_takes_no_more_leaves_memory_as_it_is_in_the_file(tmp_path: Path) -> None:
    class Full(Journal):
        def event(self, time_s: float, text: str, values: object = None) -> None:
            raise JournalError("no space left")

    with Full.create(tmp_path / "a.journal", {}) as journal:
        better = played(KnowsBetter(), journal).recording.runs[0]
    np.testing.assert_array_equal(better.time_s, played(ScriptedRig()).recording.runs[0].time_s)
