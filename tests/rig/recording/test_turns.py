"""An angle that begins anew after a turn goes on; one that jumps by anything else is refused."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from identify.api.runs import recording_of
from identify.runs.reading import describe_turns
from rig.errors import InputError
from rig.recording.turns import turns_missing
from tests.rig.recording.support import csv_of, read, refusal

STEP_S = 0.002
TIME = np.arange(2500) * STEP_S
TRUE = 0.2 * np.sin(2 * np.pi * 3.0 * TIME) + 0.08 * np.sin(2 * np.pi * 7.3 * TIME)
TORQUE = 2.0 * np.sin(2 * np.pi * 3.0 * TIME)


def file_of(folder: Path, angle_rad: object, name: str = "run.csv", **more: object) -> str:
    noise = np.random.default_rng(0).normal(0.0, 2e-5, len(TIME))
    columns = {"time_s": TIME, "torque_nm": TORQUE, "angle_rad": np.asarray(angle_rad) + noise, **more}
    (folder / name).write_text(csv_of(columns))
    return name


@pytest.mark.parametrize("low", [0.0, -0.05, 0.1, -np.pi])
def test_an_angle_that_begins_anew_after_a_turn_goes_on(tmp_path: Path, low: float) -> None:
    (run,) = read(tmp_path, file_of(tmp_path, np.mod(TRUE - low, 2 * np.pi) + low)).runs
    assert run.angle_rad is not None
    assert np.max(np.abs(run.angle_rad - TRUE)) < 1e-3
    assert (run.wraps > 0) == (low != -np.pi)


def test_a_wrapped_angle_in_degrees_beside_a_rate_agrees_with_it(tmp_path: Path) -> None:
    rate = np.gradient(TRUE, STEP_S)
    columns = {"time_s": TIME, "torque_nm": TORQUE, "rate_rad_s": rate}
    columns["angle_deg"] = np.mod(np.degrees(TRUE) + 357.0, 360.0)
    (tmp_path / "run.csv").write_text(csv_of(columns))
    (run,) = read(tmp_path, "run.csv").runs
    assert run.angle_rad is not None and run.wraps > 0
    assert np.max(np.abs(run.angle_rad - TRUE + np.radians(3.0))) < 1e-3
    (said,) = describe_turns([run], lambda _: None)
    assert "starts again at zero" in said and f"run.csv ({run.wraps} times)" in said


def test_runs_of_one_sensor_count_from_the_same_zero(tmp_path: Path) -> None:
    file_of(tmp_path, np.mod(TRUE, 2 * np.pi), "a.csv")
    file_of(tmp_path, 0.1 * TRUE - 0.3 + 2 * np.pi, "b.csv")
    recording = read(tmp_path, "a.csv", entry="    - file: b.csv\n")
    one, other = (run.angle_rad for run in recording.runs)
    assert one is not None and other is not None
    assert np.median(one) == pytest.approx(0.0, abs=0.02) and np.median(other) == pytest.approx(-0.3, abs=0.02)


def test_samples_on_the_way_back_are_left_out(tmp_path: Path) -> None:
    wrapped = np.mod(TRUE, 2 * np.pi)
    at = np.flatnonzero(np.abs(np.diff(wrapped)) > 3.0)
    wrapped[at] = 0.6 * wrapped[at] + 0.4 * wrapped[at + 1]
    (run,) = read(tmp_path, file_of(tmp_path, wrapped)).runs
    assert run.angle_rad is not None and run.wraps == len(at)
    assert not run.valid[at].any() and run.valid.sum() == len(TIME) - len(at)
    assert np.max(np.abs(run.angle_rad - TRUE)[run.valid]) < 1e-3


def test_a_sensor_that_dithers_where_it_begins_anew_stands_still() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-3, 2000)
    angle = np.mod(noise, 2 * np.pi)
    turns = turns_missing(np.arange(2000) * 1e-3, angle, np.ones(2000, dtype=bool))
    assert np.ptp(angle + 2 * np.pi * turns) < 0.01


def test_an_angle_that_turns_on_and_on_is_unwrapped_across_lost_samples(tmp_path: Path) -> None:
    true = 30.0 * TIME + 4.0 * TIME**2
    valid = np.ones(len(TIME))
    valid[300:340] = valid[1000:1003] = 0.0
    (run,) = read(tmp_path, file_of(tmp_path, np.mod(true, 2 * np.pi), valid=valid)).runs
    assert run.angle_rad is not None
    off = (run.angle_rad - true)[run.valid]
    assert np.ptp(off) < 1e-3


def test_a_jump_that_is_no_whole_turn_is_refused_with_time_size_and_cure(tmp_path: Path) -> None:
    message = refusal(tmp_path, file_of(tmp_path, TRUE + 3.0 * (TIME > 2.5)))
    assert "jumps by 2.99" in message and "at 2.502 s" in message
    assert "to_s: 2.5 " in message and "from_s: 2.502" in message


def test_a_jump_that_takes_two_samples_is_refused(tmp_path: Path) -> None:
    angle = TRUE + 3.0 * (TIME > 2.5)
    angle[1251] -= 1.8
    message = refusal(tmp_path, file_of(tmp_path, angle))
    assert "jumps by 2.98" in message and "no whole turn" in message


def test_a_sensor_that_begins_anew_after_less_than_a_turn_is_refused(tmp_path: Path) -> None:
    message = refusal(tmp_path, file_of(tmp_path, np.mod(TRUE, 5.0)))
    assert "times more" in message and "correct recorded.scale.angle" in message


def test_the_run_can_be_split_where_the_angle_jumps(tmp_path: Path) -> None:
    name = file_of(tmp_path, TRUE + 3.0 * (TIME > 2.5))
    entry = f"      to_s: 2.5\n    - file: {name}\n      from_s: 2.502\n"
    assert len(read(tmp_path, name, entry=entry).runs) == 2


def test_single_wrong_samples_and_coarse_encoders_are_no_jumps(tmp_path: Path) -> None:
    spiked = TRUE.copy()
    spiked[[400, 1200]] += 1.0
    assert len(read(tmp_path, file_of(tmp_path, spiked)).runs) == 1
    rest = 0.003 * np.round(TRUE * (TIME < 0.3) / 0.003)
    columns = {"time_s": TIME, "torque_nm": TORQUE, "angle_rad": rest}
    (tmp_path / "coarse.csv").write_text(csv_of(columns))
    assert len(read(tmp_path, "coarse.csv").runs) == 1


def test_a_linear_axis_has_no_turns(tmp_path: Path) -> None:
    message = refusal(tmp_path, file_of(tmp_path, TRUE + 2 * np.pi * (TIME > 2.5)), "  axis: linear\n")
    assert "the position jumps by 6.2" in message and " m at 2.502 s" in message


def test_an_angle_too_fast_to_be_unwrapped_is_refused(tmp_path: Path) -> None:
    message = refusal(tmp_path, file_of(tmp_path, np.random.default_rng(1).uniform(0.0, 6.28, len(TIME))))
    assert "four samples a turn" in message and "recorded.columns.angle" in message


def test_a_long_recording_is_unwrapped_across_its_blocks(tmp_path: Path) -> None:
    time_s = np.arange(600_000) * 1e-3
    true = 2.0 * time_s + 0.3 * np.sin(time_s)
    with h5py.File(tmp_path / "long.h5", "w") as file:
        file["time_s"], file["torque_nm"] = time_s, np.sin(time_s)
        file["angle_rad"] = np.mod(true, 2 * np.pi)
    (run,) = read(tmp_path, "long.h5", "  most_samples: 20000\n").runs
    assert run.angle_rad is not None and run.excerpt is not None
    off = run.angle_rad - np.interp(run.time_s, time_s, true)
    assert np.ptp(off) < 1e-3 and run.wraps == int(true[-1] / (2 * np.pi))


def test_arrays_are_unwrapped_and_refused_alike() -> None:
    arrays = {"torque_nm": TORQUE, "rate_rad_s": None, "angle_rad": np.mod(TRUE, 2 * np.pi), "valid": None}
    (run,) = recording_of(TIME, arrays, {}, None, "band_limited").runs
    assert run.angle_rad is not None and np.max(np.abs(run.angle_rad - TRUE)) < 1e-9
    arrays["angle_rad"] = TRUE + 3.0 * (TIME > 2.5)
    with pytest.raises(InputError, match=r"jumps by 2\.99"):
        recording_of(TIME, arrays, {}, None, "band_limited")
