"""Columns of a matrix, and of rows with named fields: what programs save as one array."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

MOST_COLUMNS = 256
SLENDER = 4  # times as long as wide: else nobody knows which way the samples run


def is_matrix(shape: Sequence[int]) -> bool:
    """Whether an array of this shape is one of several columns, or of several rows that are columns."""
    return len(shape) == 2 and 1 < min(shape) <= MOST_COLUMNS and max(shape) >= SLENDER * min(shape)


def names_of(name: str, shape: Sequence[int], labels: Sequence[str], matlab: bool) -> list[str]:
    """What the columns of a matrix are called, in their order.

    Parameters
    ----------
    labels
        What its columns are called; as many as it has, or none.
    matlab
        Whether a column without a label is called as MATLAB calls it, data(:,1), or as NumPy does, data[:,0].
    """
    if labels:
        return list(labels)
    first, form = (1, "{}({})") if matlab else (0, "{}[{}]")
    lies = shape[0] < shape[1]
    return [form.format(name, f"{i},:" if lies else f":,{i}") for i in range(first, min(shape) + first)]


def column_of(values: NDArray[Any], at: int) -> NDArray[Any]:
    """The column number ``at`` of a matrix, counted from 0."""
    column: NDArray[Any] = values[at] if values.shape[0] < values.shape[1] else values[:, at]
    return column


def labels_for(count: int, beside: Iterable[Sequence[str]]) -> list[str]:
    """The names of ``count`` columns among texts that stand beside a matrix; empty where none fit, or several do."""
    fitting = {tuple(text.strip() for text in texts) for texts in beside if len(texts) == count}
    (labels,) = fitting if len(fitting) == 1 else ((),)
    return list(labels) if len(set(labels)) == count and all(labels) else []


def parts_of(
    name: str, shape: Sequence[int], fields: Sequence[str] | None, labels: Sequence[str], taken: Mapping[str, Any]
) -> dict[str, int | str]:
    """Column -> its number, or its field, of an array of several; empty for one that is a column itself.

    A name that another column has is put behind that of the array.
    """
    if fields is not None:
        named: dict[str, int | str] = {field: field for field in fields}
    elif is_matrix(shape):
        named = {column: i for i, column in enumerate(names_of(name, shape, labels, matlab=False))}
    else:
        return {}
    return {column if column not in taken else f"{name}.{column}": at for column, at in named.items()}


def part_of(values: NDArray[Any], at: int | str) -> NDArray[Any]:
    """What ``parts_of`` calls by ``at``."""
    part: NDArray[Any] = values.reshape(-1)[at] if isinstance(at, str) else column_of(values, at)
    return part
