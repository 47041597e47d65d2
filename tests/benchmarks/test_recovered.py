"""What the benchmarks of kills and faults say was lost is held against files that are written here."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

if sys.platform == "win32":
    pytest.skip("emulated devices need pseudo terminals", allow_module_level=True)

from benchmarks.emulated import recovered
from drivers.capture.wire_capture import Capture
from rig.recording.journal import Journal


def _files(folder: Path, starts_s: tuple[float, ...], ticks: tuple[tuple[float, ...], ...]) -> None:
    """A capture with the marks of sets, and a journal with the ticks of as many as are given."""
    capture = Capture(folder / "raw")
    for start_s in starts_s:
        capture.mark(start_s, "begin_set", {"start_s": start_s})
        capture.tick(start_s + 0.015, 0.0)
    capture.close()
    with Journal.create(folder / "recording.journal", {}) as journal:
        for number, times_s in enumerate(ticks):
            journal.begin_run(f"set {number}", {}, {"ticks": ("time_s", "late_s")})
            journal.append("ticks", [(time_s, 0.0) for time_s in times_s])
            journal.end_run()


def test_the_last_of_a_set_is_counted_from_the_start_of_that_set(tmp_path: Path) -> None:
    _files(tmp_path, (10.0, 20.0), ((0.0, 1.5), (0.0, 0.25)))
    assert recovered(tmp_path).last_sample_s == pytest.approx(20.25)


def test_of_a_set_that_just_began_nothing_before_its_start_is_lost(tmp_path: Path) -> None:
    _files(tmp_path, (10.0, 11.85), ((0.0, 1.5),))
    found = recovered(tmp_path)
    assert found.in_set
    assert found.last_sample_s == 11.85  # and not the end of the set before it, a third of a second earlier


def test_a_first_set_without_a_row_is_lost_from_its_start(tmp_path: Path) -> None:
    _files(tmp_path, (10.0,), ())
    assert recovered(tmp_path).last_sample_s == 10.0
