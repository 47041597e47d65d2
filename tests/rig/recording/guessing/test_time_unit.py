"""The unit of the time: what the file says, and what the numbers allow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rig.recording.guessing.columns import columns_of
from rig.recording.guessing.factor import Factor, stated_factor
from rig.recording.guessing.time_unit import time_factor
from rig.recording.table import Table
from tests.rig.recording.support import csv_of, motion, read, refusal

SECONDS = np.arange(500) * 2e-3
DAY_S = 86_400.0
EPOCH_S = 1.75e9 + SECONDS


def found(name: str, values: np.ndarray) -> Factor:
    named = {name: values, "other": np.sin(values)}
    column = columns_of(Table(Path("r.csv"), tuple(named), lambda names: {n: named[n] for n in names}))[0]
    return time_factor(column, stated_factor("time", column, "rotary", name == "time_s"))


@pytest.mark.parametrize(
    ("name", "values", "factor"),
    [
        ("Date", 45_000.3 + SECONDS / DAY_S, DAY_S),
        ("timestamp", EPOCH_S, 1.0),
        ("timestamp", 1e3 * EPOCH_S, 1e-3),
        ("timestamp", 1e6 * EPOCH_S, 1e-6),
        ("timestamp", np.round(1e9 * EPOCH_S), 1e-9),
        ("uptime", 30_000.0 + SECONDS, 1.0),
        ("t", SECONDS, 1.0),
    ],
)
def test_the_size_of_the_numbers_and_their_step_say_the_unit(name: str, values: np.ndarray, factor: float) -> None:
    assert found(name, values).sure
    assert found(name, values).value == factor


@pytest.mark.parametrize(
    ("name", "values", "guess", "words"),
    [
        ("time_s", 45_000.3 + SECONDS / DAY_S, DAY_S, "days: 86400"),
        ("time [s]", SECONDS / 3600, 1.0, "h: 3600"),
        ("time_us", 1e-3 * SECONDS, 1e-6, "s: 1"),
        ("t", SECONDS / DAY_S, 1.0, "days: 86400"),
    ],
)
def test_a_unit_that_makes_more_than_a_million_samples_a_second_has_to_be_confirmed(
    name: str, values: np.ndarray, guess: float, words: str
) -> None:
    factor = found(name, values)
    assert not factor.sure and factor.value == guess
    assert words in factor.why
    assert "samples a second would be far more than a platform needs" in factor.why


@pytest.mark.parametrize("per_s", [1e3, 1e6, 1e9])
def test_stamps_since_1970_in_small_units_are_read(per_s: float, tmp_path: Path) -> None:
    columns = motion() | {"time_s": np.round(per_s * (1.75e9 + motion()["time_s"]))}
    (tmp_path / "r.csv").write_text(csv_of(columns))
    run = read(tmp_path, "r.csv", f"  scale: {{time: {1 / per_s}}}\n").runs[0]
    np.testing.assert_allclose(run.time_s - run.time_s[0], motion()["time_s"], atol=1e-6)


def test_a_date_of_a_spreadsheet_is_not_taken_for_seconds(tmp_path: Path) -> None:
    columns = motion() | {"time_s": 45_000.3 + motion()["time_s"] / DAY_S}
    del columns["angle_rad"]
    (tmp_path / "r.csv").write_text(csv_of(columns))
    assert "set recorded.scale.time: 86400; if it is in seconds" in refusal(tmp_path, "r.csv")
    run = read(tmp_path, "r.csv", "  scale: {time: 86400}\n").runs[0]
    np.testing.assert_allclose(run.time_s - run.time_s[0], motion()["time_s"], atol=2e-6)
