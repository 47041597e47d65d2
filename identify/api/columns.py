"""One argument to one column of numbers, or a plain sentence that says which value is wrong and how to mend it."""

from __future__ import annotations

from typing import Any

import numpy as np

from rig.arrays import Array, Mask
from rig.errors import InputError

_TEXT, _DATES = "SUO", "mM"


def column(name: str, values: Any, where: str = "") -> Array:
    """``values`` as float64 of shape (n,).

    Parameters
    ----------
    name
        The argument as the caller wrote it.
    values
        Anything that numpy makes an array of: a list, an array, a column of a data frame.
    where
        The run ("run 2: "), put in front of the message.

    Raises
    ------
    InputError
        For text, dates, complex or masked values, and for what has no shape (n,).
    """
    said = f"{where}{name}"
    if np.ma.isMaskedArray(values):
        raise InputError(f"{said} is a masked array: pass its .data, and its inverted mask as valid")
    try:
        array = np.asarray(values)
    except (ValueError, TypeError) as error:  # rows of different length; or whatever an object's __array__ raises
        raise InputError(
            f"{said} cannot be converted to an array ({error}): pass one number per sample; several runs as a list of "
            "arrays"
        ) from None
    if array.dtype.kind in _DATES:
        raise InputError(f"{said} holds dates or durations ({array.dtype}): {_in_seconds(name, array.dtype.kind)}")
    if array.ndim == 0 or (array.ndim == 1 and array.dtype.kind == "O" and any(np.ndim(v) for v in array)):
        shown = repr(values)[:60] if array.ndim == 0 else "arrays inside"
        raise InputError(f"{said} is {shown}, not a column of numbers: pass one number per sample, shape (n,)")
    if array.ndim > 1:
        cure = ".ravel()" if array.size == max(array.shape) else "one column, or several runs as a list of arrays"
        raise InputError(f"{said} has shape {array.shape}, not (n,): pass {cure}")
    if array.dtype.kind in _TEXT:
        array = _from_objects(said, array)
    if array.dtype.kind not in "fiub":
        raise InputError(f"{said} holds {array.dtype} values, not real numbers: pass numbers")
    return np.ascontiguousarray(array, dtype=np.float64)


def _in_seconds(name: str, kind: str) -> str:
    start = "t - t[0]" if kind == "M" else "t"
    return f"pass seconds as numbers, e.g. ({start}) / numpy.timedelta64(1, 's')" if "time" in name else "pass numbers"


def _from_objects(said: str, array: Any) -> Any:
    """Objects that are all numbers (a column of a data frame may hold such) as numbers; text is refused."""
    for i, value in enumerate(array):
        if isinstance(value, str | bytes) or not isinstance(value, int | float | np.number | None):
            shown = value.item() if isinstance(value, np.generic) else value
            raise InputError(f"{said} holds {shown!r:.60} at index {i}, not a number: convert it first, e.g. to float")
    return np.array([np.nan if value is None else value for value in array], dtype=float)


def increasing(name: str, time_s: Array, where: str = "") -> Array:
    """``time_s`` itself where it is finite and strictly increasing. Raises InputError."""
    finite(name, time_s, where)
    step = np.diff(time_s)
    if len(step) and not np.all(step > 0):
        i = int(np.argmin(step > 0))
        one = "stays at" if step[i] == 0 else f"falls from {time_s[i]:g} to"
        cure = "delete the duplicate" if step[i] == 0 else "sort the samples by time, or pass several runs as a list"
        raise InputError(
            f"{where}{name} {one} {time_s[i + 1]:g} s at index {i + 1} ({int((step <= 0).sum())} such steps), but has "
            f"to increase: {cure}"
        )
    return time_s


def finite(name: str, values: Array, where: str = "", valid: Mask | None = None) -> Array:
    """``values`` itself where all valid ones are finite. Raises InputError."""
    bad = ~np.isfinite(values) if valid is None else valid & ~np.isfinite(values)
    if np.any(bad):
        i = int(np.argmax(bad))
        cure = "delete the sample" if valid is None else "delete the sample from every array, or pass valid= with False"
        raise InputError(
            f"{where}{name} is {values[i]:g} at index {i} ({int(bad.sum())} such samples): {cure}"
            + ("" if valid is None else " there")
        )
    return values


def same_length(name: str, values: Array, time_s: Array, where: str = "") -> Array:
    """``values`` itself where it has a value for every time. Raises InputError."""
    if len(values) != len(time_s):
        raise InputError(
            f"{where}{name} has {len(values)} values and time_s has {len(time_s)}: pass one value for every time"
        )
    return values
