"""What a reader hands over: columns by name, read when asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Array
from rig.errors import RecordingError

MAX_SAMPLES = 10_000_000


def index_label(index: int) -> str:
    """How an array's sample is called: by its index."""
    return f"index {index}"


@dataclass(frozen=True)
class Table:
    """Named columns of one file.

    ``read`` gives the columns asked for, each float64 of shape (n,), and raises RecordingError for what is
    not a plain column of numbers. ``label`` says where a sample stands in the file, ``units`` what stood as the unit
    of a column besides its name, ``first_row`` how many rows of the file stand before those of the table. ``notes``
    says what a person has to know of how the file was read, in words.
    """

    path: Path
    names: tuple[str, ...]
    read: Callable[[Sequence[str]], Mapping[str, Array]]
    label: Callable[[int], str] = index_label
    units: Mapping[str, str] = field(default_factory=dict)
    first_row: int = 0
    notes: Callable[[], Sequence[str]] = tuple


class SingleNumberError(RecordingError):
    """A number where a column is needed."""

    def __init__(self, message: str, value: float) -> None:
        super().__init__(message)
        self.value = value


def too_long(path: Path, count: int) -> RecordingError:
    """The refusal of a recording that would fill the memory."""
    return RecordingError(
        f"{path}: {count} samples, at most {MAX_SAMPLES} are read: cut it into runs or lower its sample rate"
    )


def plain_column(path: Path, name: str, values: Any) -> Array:
    """``values`` as a float64 column of shape (n,); (n, 1) and (1, n) are columns too, as MATLAB has them.

    Raises RecordingError for tables, single numbers, text, complex or structured values.
    """
    array: NDArray[Any] = np.asarray(values)
    where = f"{path}: column {name!r}"
    if array.dtype.names is not None:
        raise RecordingError(f"{where} is a structure of {', '.join(array.dtype.names)}: save each as its own array")
    if array.dtype.kind == "c":
        raise RecordingError(f"{where} holds complex numbers: save its real part")
    if array.dtype.kind not in "fiub":
        raise RecordingError(f"{where} holds {array.dtype} values, not numbers: save it as numbers")
    if array.ndim == 0:
        raise SingleNumberError(f"{where} is a single number: it needs one value per sample", float(array))
    if array.size != max(array.shape):
        raise RecordingError(
            f"{where} has shape {array.shape}: save each quantity as an array of its own, of shape (n,), or name one "
            "of its columns, as `rig init` lists them"
        )
    if array.size > MAX_SAMPLES:
        raise too_long(path, array.size)
    return np.ascontiguousarray(array.reshape(-1), dtype=np.float64)


def read_each(path: Path, get: Callable[[str], Any]) -> Callable[[Sequence[str]], Mapping[str, Array]]:
    """The ``read`` of a table whose columns can be had one by one."""

    def read(names: Sequence[str]) -> Mapping[str, Array]:
        return {name: plain_column(path, name, get(name)) for name in names}

    return read
