"""A map of times that became known afterwards, on its way through a journal."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.recording import Journal, read_journal, recording_from_journal
from rig.recording.retiming import BEGUN_S, event_values, retimed, retiming_from_event, retiming_of

SAMPLES = ([100.0, 100.5, 101.0], [99.9, 100.5, 101.1])


def written(path: Path, values: dict[str, Any] | None) -> None:
    with Journal.create(path, {}) as journal:
        journal.begin_run("r", {"torque_hold": "zero_order", BEGUN_S: 100.0})
        journal.append("samples", [[0.0, 1.0, 1.0], [0.25, 2.0, 1.0], [1.0, 3.0, 1.0]])
        journal.append("commands", [[0.0, 1.0, 1.0], [0.5, 2.0, 2.0]])
        journal.end_run()
        if values is not None:
            journal.event(102.0, "better", values)


def test_times_move_as_the_points_say_and_those_outside_as_the_outermost() -> None:
    points = retiming_of(100.0, SAMPLES, ((), ()))
    assert points.torque is None
    found = retimed(np.array([-1.0, 0.0, 0.25, 0.5, 1.0, 2.0]), points.samples)
    np.testing.assert_allclose(found, [-1.1, -0.1, 0.2, 0.5, 1.1, 2.1], atol=1e-12)


def test_an_event_says_every_digit_of_the_map() -> None:
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.random(20)) + 3e4
    found = retiming_of(3e4, (times, times + 1e-5 * np.arange(20)), ((), ()))
    again = retiming_from_event(json.loads(json.dumps(event_values(3e4, found))))
    assert again is not None and again[0] == 3e4
    assert again[1].samples is not None and found.samples is not None and again[1].torque is None
    np.testing.assert_array_equal(again[1].samples, found.samples)


def test_a_journal_read_back_has_the_better_times_and_keeps_the_tables_as_they_were(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    written(path, event_values(100.0, retiming_of(100.0, SAMPLES, ([100.0, 101.0], [99.9, 100.9]))))
    contents = read_journal(path)
    run = recording_from_journal(contents).runs[0]
    np.testing.assert_allclose(run.time_s, [-0.1, 0.2, 1.1], atol=1e-12)
    assert run.torque_time_s is not None
    np.testing.assert_allclose(run.torque_time_s, [-0.1, 0.4], atol=1e-12)
    np.testing.assert_array_equal(contents.runs[0].column("samples", "time_s"), [0.0, 0.25, 1.0])


@pytest.mark.parametrize(
    "spoilt",
    [
        {BEGUN_S: 7.0},
        {BEGUN_S: None},
        {BEGUN_S: [1]},
        {"samples": [[0.0, 1.0], [1.0, 0.0]]},
        {"samples": [[0.0, 1.0], [0.0, float("nan")]]},
        {"samples": [[0.0, 1.0], [0.0, 5.0]]},
        {"samples": [[0.0, 1.0], [0.0]]},
        {"samples": [0.0, 1.0]},
        {"samples": "a text"},
        {"samples": {"a": 1}},
        {"restamped": "yes"},
    ],
)
def test_a_map_that_is_nonsense_or_of_another_run_costs_no_sample(tmp_path: Path, spoilt: dict[str, Any]) -> None:
    values = event_values(100.0, retiming_of(100.0, SAMPLES, ((), ()))) | spoilt
    written(tmp_path / "a.journal", values)
    run = recording_from_journal(read_journal(tmp_path / "a.journal")).runs[0]
    np.testing.assert_array_equal(run.time_s, [0.0, 0.25, 1.0])


def test_a_campaign_that_was_killed_has_the_times_of_the_running_clocks(tmp_path: Path) -> None:
    written(tmp_path / "a.journal", None)
    run = recording_from_journal(read_journal(tmp_path / "a.journal")).runs[0]
    np.testing.assert_array_equal(run.time_s, [0.0, 0.25, 1.0])
