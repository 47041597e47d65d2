"""What a recording has to satisfy before anything is identified from it; every refusal says cause and cure."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Array, Mask
from rig.errors import RecordingError
from rig.recording.consistency import check_angle_against_rate, check_time_unit
from rig.recording.run import Run
from rig.recording.table import Table
from rig.recording.turns import check_jumps
from rig.signals import TorqueHold, Use

MIN_VALID_SAMPLES = 40  # in a row, fewer tell nothing of two states, three parameters and the noise
# No torque, rate, angle or time of a machine in SI units comes near; squares of it would overflow.
MAX_VALUE = 1e12  # of any quantity in SI units: far beyond any platform
SHORTEST_STEP_S = 1e-8  # 100 MHz: nothing samples a platform faster
MIN_PEAK = 1e-30  # a channel that stays below: squares of it would vanish


def missing_column(table: Table, quantity: str, names: Sequence[str], *, mapped: bool) -> RecordingError:
    """The refusal of a file without a needed column: what was looked for, what is there, which is nearest."""
    there = ", ".join(table.names[:20]) + (", ..." if len(table.names) > 20 else "")
    near = [n for name in names for n in difflib.get_close_matches(name, table.names, n=1, cutoff=0.6)]
    wanted = " or ".join(repr(name) for name in names)
    cure = f"correct recorded.columns.{quantity}"
    if not mapped:
        cure = (
            "columns called time, torque, rate, speed, angle or position are found if they state a unit; name others "
            f"with recorded.columns.{quantity}, or run `rig init`"
        )
    hint = f", did you mean {near[0]!r}?" if near else ""
    return RecordingError(f"{table.path}: has no column {wanted}{hint} (it has: {there}): {cure}")


def check_lengths(table: Table, columns: Mapping[str, Array]) -> None:
    """Raise RecordingError where the columns are not equally long."""
    lengths = {quantity: len(values) for quantity, values in columns.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{quantity} {count}" for quantity, count in lengths.items())
        raise RecordingError(
            f"{table.path}: columns of different length ({listed}): export one value per sample for each"
        )


def check_samples(
    table: Table, columns: Mapping[str, Array], rows: NDArray[np.intp], factors: Mapping[str, float]
) -> Mask:
    """Check the numbers of the columns as stored; gives the mask of valid samples, shape (n,).

    ``rows``, shape (n,), are their places in the table, ``factors`` those to SI units, by quantity: nanoseconds since
    1970 are large numbers and no large time. Raises RecordingError.
    """
    flags = columns.get("valid")
    if flags is not None and not np.isfinite(flags).all():
        at = table.label(int(rows[np.argmin(np.isfinite(flags))]))
        raise RecordingError(f"{table.path}: {at}: valid is empty: write 1 for a good sample, 0 for a lost one")
    if flags is not None and not np.isin(flags, (0.0, 1.0)).all():
        i = int(np.argmin(np.isin(flags, (0.0, 1.0))))
        raise RecordingError(
            f"{table.path}: {table.label(int(rows[i]))}: valid is {flags[i]:g}: write 1 for a good sample, 0 for a "
            "lost one"
        )
    valid = np.ones(len(rows), dtype=bool) if flags is None else flags != 0
    for quantity, values in columns.items():
        # A factor that makes sound numbers large is wrong itself, which ``check_run`` says.
        bad = valid & ~(min(1.0, abs(factors.get(quantity, 1.0))) * np.abs(values) <= MAX_VALUE)
        if quantity != "valid" and bad.any():
            i = int(np.argmax(bad))
            cure = "correct it, delete the row, or mark the row valid = 0"
            raise RecordingError(
                f"{table.path}: {table.label(int(rows[i]))}: {quantity} is {values[i]:g} ({bad.sum()} such samples): "
                f"{cure}"
            )
    return valid


def check_channel(table: Table, name: str, values: Array, count: int) -> None:
    """Raise RecordingError for a further channel of another length, or that never reads a usable number."""
    key = f"recorded.columns.channels.{name}"
    if len(values) != count:
        raise RecordingError(
            f"{table.path}: channel {name!r} has {len(values)} readings, time has {count}: export one value a sample "
            f"(empty where there is none), or take {key} out"
        )
    known = np.isfinite(values)
    if known.sum() < 2:
        raise RecordingError(
            f"{table.path}: channel {name!r} has {known.sum()} readings that are numbers, at least 2 are needed: "
            f"record it, or take {key} out"
        )
    if np.max(np.abs(values[known])) > MAX_VALUE:
        i = int(np.argmax(np.where(known, np.abs(values), 0.0)))
        raise RecordingError(
            f"{table.path}: {table.label(i)}: channel {name!r} is {values[i]:g}: correct it, or leave it empty"
        )


def check_run(
    run: Run, path: Path, scales_given: Collection[str] = (), axis: Literal["rotary", "linear"] = "rotary"
) -> Run:
    """``run`` itself, once it is known to be fit for identification.

    Parameters
    ----------
    scales_given
        The quantities whose factor the user stated: a stated time scale is believed.
    axis
        What an angle that jumps is called.

    Raises RecordingError.
    """
    _check_fields(run, path)
    _check_order(run.time_s, path)
    _check_own_numbers(run, path)
    count = int(run.valid.sum())
    if count < MIN_VALID_SAMPLES:
        raise RecordingError(
            f"{path}: {count} valid samples, at least {MIN_VALID_SAMPLES} are needed: "
            "record longer, or widen from_s and to_s"
        )
    _check_motion(run, path)
    check_jumps(run, path, axis)
    agrees = check_angle_against_rate(run, path)
    if "time" not in scales_given and not agrees:
        check_time_unit(run, path)
    return run


def _check_order(time_s: Array, path: Path) -> None:
    step = np.diff(time_s)
    if (step > 0).all():
        if len(step) and float(np.median(step)) < SHORTEST_STEP_S:
            raise RecordingError(
                f"{path}: samples are {float(np.median(step)):g} s apart (median), which is implausible: correct "
                "recorded.scale.time"
            )
        return
    i = int(np.argmin(step > 0))
    before, after = time_s[i], time_s[i + 1]
    if before == after:
        raise RecordingError(
            f"{path}: samples {i} and {i + 1} have the same time {after!s} s ({(step == 0).sum()} such pairs): "
            "delete the duplicates, or write the time with more digits"
        )
    raise RecordingError(
        f"{path}: time is not sorted: {after!s} s at sample {i + 1} follows {before!s} s "
        f"({(step < 0).sum()} such steps): sort the rows, or give each recording its own file"
    )


def _check_fields(run: Run, path: Path) -> None:
    """Lengths and words of a run that was read as such: the file may have been changed since it was written."""
    sampled = (run.valid, run.rate_rad_s, run.angle_rad, *run.channels.values())
    lengths = {array.shape for array in sampled if array is not None} | {run.time_s.shape}
    torque = {array.shape for array in (run.torque_time_s, run.torque_nm) if array is not None}
    known = run.use in get_args(Use) and run.torque_hold in get_args(TorqueHold)
    numbers = (run.min_rate_rad_s, run.added_inertia_kg_m2, run.frequency_hz or 0.0)
    if len(lengths) > 1 or len(torque) > 1 or run.time_s.ndim != 1:
        raise RecordingError(f"{path}: run {run.name!r}: columns of different length: export it again")
    if (run.torque_nm is None) != (run.torque_time_s is None) or not known or not np.isfinite(numbers).all():
        raise RecordingError(f"{path}: run {run.name!r} was changed after it was written: export it again")


def _check_own_numbers(run: Run, path: Path) -> None:
    """What ``check_samples`` does for a table, for runs that came as such."""
    for name, values in (("rate", run.rate_rad_s), ("angle", run.angle_rad)):
        if values is not None and not np.isfinite(values[run.valid]).all():
            i = int(np.argmax(run.valid & ~np.isfinite(values)))
            raise RecordingError(f"{path}: run {run.name!r}: {name} at sample {i} is {values[i]:g} though valid")
    if run.torque_nm is not None and run.torque_time_s is not None:
        if not np.isfinite(run.torque_nm).all():
            raise RecordingError(f"{path}: run {run.name!r}: a torque is not a number: delete those rows")
        _check_order(run.torque_time_s, path)


def _check_motion(run: Run, path: Path) -> None:
    channel, values = ("rate", run.rate_rad_s) if run.rate_rad_s is not None else ("angle", run.angle_rad)
    if values is None:
        raise RecordingError(f"{path}: holds neither rate nor angle: export one of them")
    if (
        run.rate_rad_s is not None
        and run.angle_rad is not None
        and np.ptp(run.angle_rad[run.valid]) == 0.0 < np.ptp(run.rate_rad_s[run.valid])
    ):
        raise RecordingError(
            f"{path}: the angle never changes ({run.angle_rad[run.valid][0]:g}) though the rate does: check that the "
            "encoder was connected, or leave it out: set recorded.columns.angle: none"
        )
    for name, given in ((channel, values[run.valid]), ("torque", run.torque_nm)):
        largest = float(np.max(np.abs(given))) if given is not None and len(given) else 0.0
        if 0.0 < largest < MIN_PEAK:
            raise RecordingError(
                f"{path}: the {name} never exceeds {largest:g}, which is implausible: correct recorded.scale.{name}"
            )
        if largest > MAX_VALUE:
            raise RecordingError(
                f"{path}: the {name} reaches {largest:g}, which is implausible: correct recorded.scale.{name}"
            )
    if np.ptp(values[run.valid]) > 0:
        return
    torque = run.torque_nm
    if torque is None or not len(torque) or np.ptp(torque) == 0:
        detail = "and the torque is constant too" if torque is not None else "and there is no torque"
        raise RecordingError(
            f"{path}: the {channel} never changes ({values[run.valid][0]:g}) {detail}, so the data determine "
            "nothing: record a run in which the torque changes and the platform moves"
        )
    raise RecordingError(
        f"{path}: the {channel} never changes ({values[run.valid][0]:g}) though the torque does: check that the "
        "sensor was connected and that the platform was free to move"
    )
