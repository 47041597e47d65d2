"""Origin of the data: read by a person, and copied from."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import yaml

from identify.report.page.origin import origin
from tests.identify.sample import sample

SET = {
    "name": "3 Hz", "complete": True, "missed_ticks": 33, "invalid_samples": 0, "peak_torque_nm": 106.95586862248085,
    "late_ms_p50": 0.018382300532166516, "late_ms_p99": 0.0732944, "late_ms_p99.9": 1.4648, "late_ms_p100": 9.9097,
}  # fmt: skip
CONFIG = {"name": "a", "excitation": {"sets": [{"kind": "sine", "torque_nm": 60.0, "travel_cap_deg": None}]}}


def page(**info: Any) -> str:
    _, recording = sample(1.0)
    return origin(replace(recording, info=info)).html


def test_the_configuration_as_understood_is_yaml() -> None:
    text = re.search(r"<pre[^>]*>(.*?)</pre>", page(config=CONFIG), re.DOTALL)
    assert text is not None
    assert yaml.safe_load(text[1]) == CONFIG


def test_how_late_the_loop_was_is_a_table_of_the_sets() -> None:
    shown = page(sets=[SET])
    assert "<caption><span>Time base" in shown
    assert "99.9 %" in shown
    assert "106.9" in shown and "106.955868" not in shown
    assert "{&#x27;" not in shown


def test_times_numbers_and_yes_or_no_are_those_of_a_person() -> None:
    shown = page(
        started_utc="2026-11-28T18:52:49.303838+00:00", bench={"gyro": {"rate_hz": 2001.7496367291533}}, x=True
    )
    assert '<th scope="row">started (UTC)</th><td>2026-11-28 18:52:49</td>' in shown
    assert '<th scope="row">bench.gyro.rate_hz</th><td>2001.75</td>' in shown
    assert "True" not in shown


def test_one_run_is_no_runs() -> None:
    _, recording = sample(1.0)
    assert "<td>1 run, " in origin(replace(recording, runs=recording.runs[:1], info={})).html


def test_files_that_the_configuration_reads_stand_under_their_names() -> None:
    shown = page(config_file="rig.yaml", config_text="name: a\n", config_included={"model.yaml": "inertia_kg_m2: 1\n"})
    assert "<summary>rig.yaml as written</summary>" in shown
    assert "<summary>model.yaml as included</summary>" in shown


def test_a_value_that_no_file_has_a_word_for_is_shown_all_the_same() -> None:
    shown = page(
        sets=[{"name": "<b>"}], config={"odd": object}, versions={"numpy": "2"}, aborted=None, notes=[1.5, "a"]
    )
    assert "<b>" not in shown
    assert "1.5; a" in shown
