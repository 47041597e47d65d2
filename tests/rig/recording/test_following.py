"""A journal that is followed while it is written gives every frame once, whole, in order."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rig.recording.following import JournalFollower, rows_of
from rig.recording.journal import BLOCK, CLOSE, HEADER, RUN, RUN_END, Journal, frame


def test_frames_come_once_and_in_order_as_they_are_written(tmp_path: Path) -> None:
    path = tmp_path / "x.journal"
    with Journal.create(path, {"axis": "rotary"}) as journal:
        follower = JournalFollower(path)
        assert [kind for kind, _ in follower.new_frames()] == [HEADER]
        journal.begin_run("3 Hz", {"use": "auto"})
        journal.append("samples", np.array([[0.0, 0.1, 1.0], [0.001, 0.2, 1.0]]))
        journal.flush()
        (run, _), (block, payload) = follower.new_frames()
        assert (run, block) == (RUN, BLOCK)
        kind, rows = rows_of(payload)
        assert kind == "samples"
        np.testing.assert_array_equal(rows, [[0.0, 0.1, 1.0], [0.001, 0.2, 1.0]])
        assert list(follower.new_frames()) == []
        journal.end_run(True)
    assert [kind for kind, _ in follower.new_frames()] == [RUN_END, CLOSE]


def test_a_frame_that_is_half_written_waits_for_its_other_half(tmp_path: Path) -> None:
    path, whole = tmp_path / "x.journal", frame(RUN, b"{}")
    path.write_bytes(whole[:-1])
    follower = JournalFollower(path)
    assert list(follower.new_frames()) == []
    path.write_bytes(whole)
    assert list(follower.new_frames()) == [(RUN, b"{}")]


def test_what_is_no_frame_is_not_passed_on(tmp_path: Path) -> None:
    path = tmp_path / "x.journal"
    path.write_bytes(frame(RUN, b"{}")[:-1] + b"!")
    assert list(JournalFollower(path).new_frames()) == []
