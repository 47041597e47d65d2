"""A second time that differs from the first is said; a second stamp of the same rows is no other clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rig.recording.guessing.clocks import with_one_clock
from rig.recording.guessing.columns import columns_of
from rig.recording.guessing.roles import Choice, guess_roles
from rig.recording.table import Table

T = np.arange(1500) * 2e-3
TORQUE, RATE = np.sin(9.0 * T), np.cos(31.0 * T)
HALF = np.where(np.arange(1500) < 750, 2 * T, np.nan)


def time_of(given: str | None = None, **columns: np.ndarray) -> Choice:
    named = {name.replace("__", " "): values for name, values in columns.items()}
    found = columns_of(Table(Path("r.csv"), tuple(named), lambda names: {n: named[n] for n in names}))
    said = {} if given is None else {"time": next(c for c in found if c.name == given)}
    return with_one_clock(guess_roles(found, said), found, "time_s")["time"]


@pytest.mark.parametrize(
    "columns",
    [
        {"t_torque__[s]": T, "torque": TORQUE, "t_rate__[s]": T + 0.5, "rate": RATE},
        {"time__[s]": T, "torque": TORQUE, "time2__[ms]": 2e3 * T, "rate": RATE},
        {"time_s": T, "torque": TORQUE, "gyro_time": 1.1 * T, "rate": RATE},
        {"t_torque__[s]": T, "torque": TORQUE, "t_rate__[s]": HALF, "rate": np.where(np.isnan(HALF), np.nan, RATE)},
    ],
)
def test_two_clocks_that_differ_leave_the_time_to_whoever_knows(columns: dict[str, np.ndarray]) -> None:
    choice = time_of(**columns)
    assert choice.column is None and not choice.sure
    assert choice.why.startswith("two clocks that differ") and "interpolate" in choice.why
    first = next(iter(columns)).replace("__", " ")
    assert time_of(first, **columns).column is not None


@pytest.mark.parametrize(
    "columns",
    [
        {"time_s": T, "millis": np.round(1e3 * T + 1234.0)},
        {"epoch": 1.75e9 + T, "time__[ms]": 1e3 * T},
        {"time_s": T, "received__[s]": T * (1 + 1e-4) + 0.01 * np.sin(40.0 * T) + 17.0},
        {"torque.Time": T, "rate.Time": T},
        {"time_s": T, "index": np.arange(1500.0)},
        {"time_s": T, "clock": np.floor(T * 10)},
    ],
)
def test_another_stamp_of_the_same_rows_is_no_second_clock(columns: dict[str, np.ndarray]) -> None:
    assert time_of(**columns, torque=TORQUE, rate=RATE).column is not None
