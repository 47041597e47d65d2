"""Arguments of a call to a Recording: one array or a list of arrays each, checked as a file would be."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from identify.api.columns import column, finite, increasing, same_length
from rig.arrays import Array, Mask
from rig.errors import InputError, RecordingError
from rig.recording.checks import check_run
from rig.recording.run import Recording, Run
from rig.recording.turns import on_one_turn, unwrapped
from rig.signals import TorqueHold, Use

SAMPLED = ("torque_nm", "rate_rad_s", "angle_rad", "valid")
_OF_A_RUN = ("time_s", "rate_rad_s", "angle_rad", "torque_time_s", "torque_nm")
# What the checks of files say is the cure, and what it is for arrays.
_ARGUMENT = {"time": "time_s", "torque": "torque_nm", "rate": "rate_rad_s", "angle": "angle_rad"}
_FACTOR = re.compile(r"(?:set )?recorded\.scale\.(time|torque|rate|angle): ([-\d.e]+)")
_UNIT = re.compile(r"recorded\.scale\.(time|torque|rate|angle)")
_LEFT_OUT = re.compile(r"(?:leave it out: )?set recorded\.columns\.(torque|rate|angle): none")
_COLUMN = re.compile(r"recorded\.columns\.(time|torque|rate|angle)")
_SPLIT = re.compile(r"split the run there \(.*?\)")
_BELIEVED = re.compile(r"; if it is in seconds.*$")


def recording_of(
    time_s: Any, arrays: Mapping[str, Any], channels: Mapping[str, Any], uses: Sequence[Use] | None,
    torque_hold: TorqueHold, axis: Literal["rotary", "linear"] = "rotary",
) -> Recording:  # fmt: skip
    """A Recording of arrays.

    Parameters
    ----------
    time_s
        Shape (n,), or a list with one array a run.
    arrays
        ``torque_nm``, ``rate_rad_s``, ``angle_rad`` and ``valid``, each as ``time_s`` is; None where not measured.
    channels
        Readings of further channels by name, each as ``time_s`` is.
    uses
        "auto", "fit" or "holdout" for every run, or None.
    axis
        An angle of a rotary one may begin anew after a turn.

    Raises
    ------
    InputError
        For whatever cannot be used, with the value and the cure.
    """
    count = len(time_s) if _are_several(time_s) else None
    if count == 0:
        raise InputError("time_s is empty: pass one array, or a list with one array a run")
    given = {name: _by_run(name, values, count) for name, values in arrays.items()}
    read = {name: _by_run(f"channels[{name!r}]['values']", values, count) for name, values in channels.items()}
    runs = []
    for i, times in enumerate(time_s if count is not None else [time_s]):
        where = "" if count is None else f"run {i + 1}: "
        one = {name: values[i] for name, values in given.items()}
        run = _run(f"run {i + 1}", times, one, {name: values[i] for name, values in read.items()}, where)
        runs.append(replace(run, torque_hold=torque_hold))
    return with_uses(Recording(_checked(runs, axis, count is not None), axis), uses)


def with_uses(recording: Recording, uses: Sequence[Use] | None) -> Recording:
    """The recording with ``use`` of every run as given. Raises InputError where the number of runs differs."""
    if uses is None:
        return recording
    if len(uses) != len(recording.runs):
        raise InputError(
            f"holdout has {len(uses)} entries and there are {len(recording.runs)} runs: give one for every run"
        )
    return replace(recording, runs=tuple(replace(r, use=u) for r, u in zip(recording.runs, uses, strict=True)))


def checked_recording(recording: Recording) -> Recording:
    """A recording made by hand, its arrays converted and checked. Raises InputError."""
    if not recording.runs:
        raise InputError("the recording has no runs: pass at least one")
    return replace(recording, runs=_checked([_converted(run) for run in recording.runs], recording.axis, True))


def _checked(runs: Sequence[Run], axis: Literal["rotary", "linear"], named: bool) -> tuple[Run, ...]:
    """The runs, once they are known to be fit for identification; an angle within one turn is made to go on.

    Raises InputError, with the cure for arrays.
    """
    each = [_checked_run(run, axis, named) for run in runs]
    return tuple(on_one_turn(each) if axis == "rotary" else each)


def _checked_run(run: Run, axis: Literal["rotary", "linear"], named: bool) -> Run:
    path = Path(run.name)
    try:
        return check_run(unwrapped(run, path) if axis == "rotary" else run, path, axis=axis)
    except RecordingError as error:
        text = str(error)
        raise InputError(for_arrays(text if named else text.removeprefix(f"{run.name}: "))) from None


def for_arrays(message: str) -> str:
    """What a check says of a file, said of arrays."""
    text = _FACTOR.sub(lambda m: f"multiply {_ARGUMENT[m[1]]} by {m[2]}", message)
    text = _UNIT.sub(lambda m: f"the unit of {_ARGUMENT[m[1]]}", text)
    text = _LEFT_OUT.sub(lambda m: f"leave {_ARGUMENT[m[1]]} out", _BELIEVED.sub("", text))
    text = _COLUMN.sub(lambda m: _ARGUMENT[m[1]], text)
    text = _SPLIT.sub("pass the samples before and behind it as two runs", text)
    text = text.replace(", or name no angle column and delete that one", ", or leave angle_rad out")
    return text.replace(", or widen from_s and to_s", "")


def _are_several(values: Any) -> bool:
    """Whether this is a list of arrays; a list of numbers is one array."""
    return isinstance(values, list | tuple) and (len(values) == 0 or not all(_is_single(v) for v in values[:1]))


def _is_single(value: Any) -> bool:
    return isinstance(value, str | bytes) or np.ndim(value) == 0


def _by_run(name: str, values: Any, count: int | None) -> Sequence[Any]:
    """One entry a run, None where a run has none."""
    if values is None:
        return [None] * (count or 1)
    if count is None:
        if _are_several(values):
            raise InputError(f"{name} is a list of {len(values)} arrays and time_s is one array: pass one array, too")
        return [values]
    several = isinstance(values, list | tuple) and not (values and all(v is not None and _is_single(v) for v in values))
    if not several:
        raise InputError(f"time_s is a list of {count} runs and {name} is not: pass a list with one array a run")
    if len(values) != count:
        raise InputError(f"{name} has {len(values)} runs and time_s has {count}: pass one array for every run")
    return list(values)


def _run(name: str, times: Any, given: Mapping[str, Any], readings: Mapping[str, Any], where: str) -> Run:
    if times is None:
        raise InputError(f"{where}time_s is None: pass the time of every sample in seconds")
    time_s = increasing("time_s", column("time_s", times, where), where)
    valid = _valid(given["valid"], time_s, where)
    columns = {
        n: finite(n, same_length(n, column(n, values, where), time_s, where), where, valid)
        for n in SAMPLED[:-1] if (values := given[n]) is not None
    }  # fmt: skip
    if "rate_rad_s" not in columns and "angle_rad" not in columns:
        raise InputError(f"{where}neither rate_rad_s nor angle_rad is given: pass at least one measured channel")
    torque = columns.get("torque_nm")
    known = None if torque is None else np.isfinite(torque)  # of a lost sample the torque may be lost, too
    channels = {
        n: same_length(f"channels[{n!r}]['values']", column(f"channels[{n!r}]['values']", v, where), time_s, where)
        for n, v in readings.items() if v is not None
    }  # fmt: skip
    return Run(
        name, time_s, valid, columns.get("rate_rad_s"), columns.get("angle_rad"),
        None if known is None else time_s[known], None if torque is None else torque[known], channels=channels,
    )  # fmt: skip


def _valid(values: Any, time_s: Array, where: str) -> Mask:
    if values is None:
        return np.ones(len(time_s), dtype=bool)
    flags = same_length("valid", column("valid", values, where), time_s, where)
    if not np.isin(flags, (0.0, 1.0)).all():
        i = int(np.argmin(np.isin(flags, (0.0, 1.0))))
        raise InputError(f"{where}valid is {flags[i]:g} at index {i}: pass True for a good sample, else False")
    return np.asarray(flags == 1.0)


def _converted(run: Run) -> Run:
    if not isinstance(run, Run):
        raise InputError(f"the recording holds {run!r:.60} where a Run has to be: make it with rig.Run")
    where = f"{run.name}: "
    arrays = {f.name: v for f in fields(run) if f.name in _OF_A_RUN and (v := getattr(run, f.name)) is not None}
    columns = {name: column(name, values, where) for name, values in arrays.items()}
    if "time_s" not in columns:
        raise InputError(f"{where}time_s is None: pass the time of every sample in seconds")
    flags = _valid(run.valid, columns["time_s"], where)
    for name in ("rate_rad_s", "angle_rad"):
        if name in columns:
            finite(name, same_length(name, columns[name], columns["time_s"], where), where, flags)
    increasing("time_s", columns["time_s"], where)
    if ("torque_nm" in columns) != ("torque_time_s" in columns):
        raise InputError(f"{where}torque_nm and torque_time_s belong together: give both or neither")
    if "torque_nm" in columns and len(columns["torque_nm"]) != len(columns["torque_time_s"]):
        count = len(columns["torque_nm"]), len(columns["torque_time_s"])
        raise InputError(f"{where}torque_nm has {count[0]} values and torque_time_s has {count[1]}: give one a time")
    channels = {n: column(f"channels[{n!r}]", v, where) for n, v in run.channels.items()}
    return replace(run, valid=flags, channels=channels, **columns)  # type: ignore[arg-type]
