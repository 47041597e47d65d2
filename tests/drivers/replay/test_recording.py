"""A raw capture alone gives the recording of every set, or is refused with the reason."""

import pytest

from drivers.replay.recording import recording_from_capture
from rig.errors import RecordingError
from tests.drivers.wireless import play, played_in_two_sets


def test_a_capture_alone_gives_every_set_as_it_was_heard(bench, tmp_path):
    live = played_in_two_sets(bench)
    recording = recording_from_capture(tmp_path / "raw" / "wire.cap")
    assert [run.name for run in recording.runs] == ["set 1", "set 2"]
    assert recording.info["expected_torque_delay"] == bench.expected_delay._asdict()
    for run, (start_s, answers) in zip(recording.runs, live, strict=True):
        gyro = [s for answer in answers for s in answer.gyro if s.time_s >= start_s]
        torque = [s for answer in answers for s in answer.torque if s.time_s >= start_s]
        assert run.rate_rad_s.tolist() == [s.rate_rad_s for s in gyro]
        assert run.valid.tolist() == [s.valid for s in gyro]
        assert run.torque_nm.tolist() == [s.torque_nm for s in torque]
        assert run.torque_hold == "zero_order"
        assert (run.rate_corner_hz, run.rate_delay_s) == bench.rate_low_pass
        assert set(run.channels) == {"drive_torque_nm", "sent_torque_nm"}
        # Stamped anew by all that was heard, which moves no stamp by more than the clocks were unsure of.
        assert run.time_s == pytest.approx([s.time_s - start_s for s in gyro], abs=1e-3)


def test_a_capture_without_a_set_or_with_records_of_no_kind_is_refused(bench, tmp_path):
    with bench.opened(), bench.armed():
        play(bench, 30)
    path = tmp_path / "raw" / "wire.cap"
    with pytest.raises(RecordingError, match="ends before the first sample of a set"):
        recording_from_capture(path)
    path.write_bytes(path.read_bytes().replace(b'"opened"', b'"closed"'))
    with pytest.raises(RecordingError, match="nothing was played"):
        recording_from_capture(path)


def test_a_mark_that_says_nonsense_is_refused(bench, tmp_path):
    played_in_two_sets(bench)
    path = tmp_path / "raw" / "wire.cap"
    path.write_bytes(path.read_bytes().replace(b'"start_s": 1', b'"start_x": 1'))
    with pytest.raises(RecordingError, match="not in the format of this version"):
        recording_from_capture(path)
