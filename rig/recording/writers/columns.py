"""A run as one table: columns of one length, as formats with a single time column need them.

Torque and samples may stand on grids of their own. Then there is a row for every instant of either: rows without a
sample are marked ``valid`` = 0, and rows without a torque get the one that the run's hold says there was, so that the
torque as a function of time is the same (bit for bit where it is held, within the spline where it is band-limited).
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from rig.arrays import Array
from rig.recording.run import Run

_NOT_IN_A_NAME = re.compile(r"\W+", re.ASCII)
OWN = frozenset(("time_s", "torque_nm", "rate_rad_s", "angle_rad", "valid", "rate_deg_s", "angle_deg", "file", "args"))


def columns_of(run: Run) -> dict[str, Array]:
    """Names as our own readers know them, values of one length."""
    time_s = run.time_s
    if run.torque_time_s is not None:
        time_s = np.union1d(run.time_s, run.torque_time_s)
    at = np.searchsorted(time_s, run.time_s)

    def on_all(values: Array) -> Array:
        spread = np.full(len(time_s), np.nan)
        spread[at] = values
        return spread

    columns: dict[str, Array] = {"time_s": time_s}
    if run.torque_nm is not None and run.torque_time_s is not None:
        columns["torque_nm"] = _torque_at(run, time_s)
    for name, values in (("rate_rad_s", run.rate_rad_s), ("angle_rad", run.angle_rad)):
        if values is not None:
            columns[name] = on_all(values)
    columns["valid"] = np.nan_to_num(on_all(run.valid.astype(float)))
    for name, values in _named(run.channels).items():
        columns[name] = on_all(values)
    return columns


def _torque_at(run: Run, time_s: Array) -> Array:
    from rig.dynamics.torque import TorqueSignal  # noqa: PLC0415  compiled kernels stand in its package

    assert run.torque_nm is not None and run.torque_time_s is not None
    torque = np.array(TorqueSignal(run.torque_time_s, run.torque_nm, run.torque_hold).at(time_s), dtype=float)
    torque[np.searchsorted(time_s, run.torque_time_s)] = run.torque_nm
    return torque


def _named(channels: Mapping[str, Array]) -> dict[str, Array]:
    """Channels under names that are a word in every format: nothing that a spreadsheet takes for a formula."""
    named: dict[str, Array] = {}
    for name, values in channels.items():
        word = _NOT_IN_A_NAME.sub("_", name).strip("_")[:60]
        if not word or word[0].isdigit() or word.lower() in OWN:
            word = f"channel_{word}"
        while word in named:
            word += "_"
        named[word] = values
    return named
