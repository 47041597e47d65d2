"""Recordings in part, from files: which are, how many samples each gets, and that formats agree."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest

from benchmarks.long_recording import write_h5
from identify.runs.excerpts import describe_excerpts
from rig.config.load import load_config
from rig.errors import RecordingError
from rig.recording.load import read_recording
from rig.recording.run import Excerpt, Run


def read(folder: Path, runs: str, more: str = "") -> tuple[Run, ...]:
    (folder / "rig.yaml").write_text(f"backend: recorded\nrecorded:\n  runs: {runs}\n{more}")
    return read_recording(load_config(folder / "rig.yaml")).runs


def test_a_recording_within_the_limit_is_read_as_it_is(tmp_path: Path) -> None:
    write_h5(tmp_path / "r.h5", 50_000, 1000.0)
    (run,) = read(tmp_path, "[{file: r.h5}]")
    with h5py.File(tmp_path / "r.h5") as file:
        np.testing.assert_array_equal(run.rate_rad_s, file["rate_rad_s"][()])
    assert run.excerpt is None


def test_a_longer_one_has_the_samples_that_were_asked_for(tmp_path: Path) -> None:
    write_h5(tmp_path / "r.h5", 200_000, 10_000.0)
    (run,) = read(tmp_path, "[{file: r.h5}]", "  most_samples: 20000\n")
    assert run.excerpt is not None and run.excerpt.factor == 10 and run.excerpt.whole
    assert 19_900 < len(run.time_s) <= 20_000
    assert run.torque_time_s is not None and len(run.torque_time_s) == len(run.time_s)


def test_windows_of_one_file_share_the_samples_by_their_lengths(tmp_path: Path) -> None:
    write_h5(tmp_path / "r.h5", 300_000, 10_000.0)
    entries = "[{file: r.h5, to_s: 9.99995, use: fit}, {file: r.h5, from_s: 10.0, use: holdout}]"
    fit, holdout = read(tmp_path, entries, "  most_samples: 15000\n")
    assert fit.excerpt is not None and holdout.excerpt is not None
    assert (fit.excerpt.samples, holdout.excerpt.samples) == (100_000, 200_000)
    assert fit.time_s[-1] < 10.0 < holdout.time_s[0]
    assert len(holdout.time_s) == pytest.approx(2 * len(fit.time_s), rel=0.02)


def test_a_short_window_of_a_long_file_is_read_as_it_is(tmp_path: Path) -> None:
    write_h5(tmp_path / "r.h5", 300_000, 10_000.0)
    (run,) = read(tmp_path, "[{file: r.h5, from_s: 5.0, to_s: 8.0}]")
    assert run.excerpt is None and len(run.time_s) == 30_001


def test_csv_and_parquet_give_what_hdf5_gives(tmp_path: Path) -> None:
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    write_h5(tmp_path / "r.h5", 30_000, 5000.0)
    with h5py.File(tmp_path / "r.h5") as file:
        columns = {name: file[name][()] for name in file}
    parquet.write_table(pyarrow.table(columns), tmp_path / "r.parquet", row_group_size=7000)
    rows = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header=",".join(columns), comments="")
    most = "  most_samples: 5000\n"
    runs = [read(tmp_path, f"[{{file: r.{ending}}}]", most)[0] for ending in ("h5", "parquet", "csv")]
    for other in runs[1:]:
        assert other.excerpt == runs[0].excerpt and other.excerpt is not None
        np.testing.assert_allclose(other.rate_rad_s, runs[0].rate_rad_s, rtol=1e-9)
        np.testing.assert_allclose(other.torque_nm, runs[0].torque_nm, rtol=1e-9)


@pytest.mark.slow  # benchmarks.growth asks it of whole identifications
def test_memory_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    peaks = []
    for count in (600_000, 2_400_000):
        write_h5(tmp_path / f"{count}.h5", count, 10_000.0)
        read(tmp_path, f"[{{file: {count}.h5}}]")  # filters are made and kept
        tracemalloc.start()
        read(tmp_path, f"[{{file: {count}.h5}}]")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0] < 1.2 * 64e6


def test_a_valid_sample_that_is_no_number_is_named_by_its_place_in_the_file(tmp_path: Path) -> None:
    write_h5(tmp_path / "r.h5", 600_000, 10_000.0)
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        file["rate_rad_s"][555_555] = np.inf
    with pytest.raises(RecordingError, match="index 555555: rate is inf"):
        read(tmp_path, "[{file: r.h5}]")


def test_rows_without_a_value_are_lost_and_counted(tmp_path: Path) -> None:
    write_h5(tmp_path / "r.h5", 600_000, 10_000.0)
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        file["rate_rad_s"][:3000] = file["torque_nm"][555_555] = np.nan
    (run,) = read(tmp_path, "[{file: r.h5}]")
    assert run.missing is not None and run.missing.within == 3001
    assert set(run.missing.quantities) == {"rate", "torque"}
    assert run.rate_rad_s is not None and np.isfinite(run.rate_rad_s[run.valid]).all()
    assert not run.valid[run.time_s < 0.29].any() and run.valid[run.time_s > 0.35].mean() > 0.99


def test_what_was_left_out_is_said() -> None:
    time = np.arange(3.0)
    cut = Run("a.h5", time, time > 0, excerpt=Excerpt(72_000_000, 21, 10.0, 130.0, 0.0, False))
    whole = Run("b.h5", time, time > 0, excerpt=Excerpt(90_000, 2, 0.0, 90.0, 0.0, True))
    said: list[str] = []
    assert describe_excerpts([Run("c.h5", time, time > 0)], said.append) == () and not said
    (told,) = describe_excerpts([cut, whole], said.append)
    assert said == [told]
    assert "a.h5: 10 to 130 s of 72 000 000 samples" in told and "every 21st kept" in told
    assert "b.h5: all of its 90 000 samples, low-passed and every 2nd kept" in told
    assert "recorded.most_samples" in told
