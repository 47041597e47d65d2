"""Arguments become the runs that a file of the same numbers would be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from identify.api.runs import recording_of, with_uses
from rig.config.load import load_config
from rig.recording.load import read_recording
from rig.recording.run import Run

N = 100
T = np.arange(N) * 1e-2
W, M, A = 0.5 * np.cos(4.0 * T), np.sin(4.0 * T), 0.125 * np.sin(4.0 * T)
NOTHING: dict[str, Any] = {"torque_nm": None, "rate_rad_s": None, "angle_rad": None, "valid": None}


def one_run(**arrays: Any) -> Run:
    return recording_of(T, NOTHING | arrays, {}, None, "band_limited").runs[0]


def test_one_array_is_one_run_and_a_list_of_arrays_several() -> None:
    assert len(recording_of(list(T), NOTHING | {"rate_rad_s": list(W)}, {}, None, "band_limited").runs) == 1
    several = recording_of(
        (T, T[:50]), NOTHING | {"rate_rad_s": [W, W[:50]], "torque_nm": [M, None]}, {}, None, "zero_order"
    )
    assert [run.name for run in several.runs] == ["run 1", "run 2"]
    assert [run.torque_nm is None for run in several.runs] == [False, True]
    assert {run.torque_hold for run in several.runs} == {"zero_order"}


def test_whole_numbers_and_objects_that_are_numbers_are_read_as_floats() -> None:
    run = one_run(
        rate_rad_s=np.array([*W[:-1], None], dtype=object), torque_nm=np.arange(N), valid=np.arange(N) < N - 1
    )
    assert run.rate_rad_s is not None and run.torque_nm is not None
    assert run.rate_rad_s.dtype == run.torque_nm.dtype == np.float64
    np.testing.assert_array_equal(run.torque_nm, np.arange(N))


def test_a_lost_sample_is_no_sample_and_a_lost_torque_no_torque() -> None:
    good = np.arange(N) != 30
    run = one_run(rate_rad_s=np.where(good, W, np.nan), torque_nm=np.where(good, M, np.nan), valid=good)
    np.testing.assert_array_equal(run.valid, good)
    assert run.torque_time_s is not None and 0.3 not in run.torque_time_s and len(run.torque_time_s) == N - 1


def test_a_table_of_the_same_numbers_reads_as_the_same_run(tmp_path: Path) -> None:
    rows = "".join(f"{t!r},{m!r},{w!r},{a!r}\n" for t, m, w, a in np.stack([T, M, W, A], axis=1).tolist())
    (tmp_path / "run.csv").write_text("time_s,torque_nm,rate_rad_s,angle_rad\n" + rows, encoding="utf-8")
    (tmp_path / "rig.yaml").write_text("backend: recorded\nrecorded: {runs: [{file: run.csv}]}\n", encoding="utf-8")
    by_file = read_recording(load_config(tmp_path / "rig.yaml")).runs[0]
    by_call = one_run(torque_nm=M, rate_rad_s=W, angle_rad=A)
    for name in ("time_s", "valid", "torque_time_s", "torque_nm", "rate_rad_s", "angle_rad"):
        np.testing.assert_array_equal(getattr(by_call, name), getattr(by_file, name))


def test_readings_of_a_channel_and_the_use_of_a_run_go_with_their_run() -> None:
    made = recording_of(
        [T, T],
        NOTHING | {"rate_rad_s": [W, W]},
        {"winding": [300.0 + T, 310.0 + T]},
        ["fit", "holdout"],
        "band_limited",
    )
    np.testing.assert_array_equal(made.runs[1].channels["winding"], 310.0 + T)
    assert [run.use for run in made.runs] == ["fit", "holdout"]
    assert [run.use for run in with_uses(made, ["holdout", "auto"]).runs] == ["holdout", "auto"]
