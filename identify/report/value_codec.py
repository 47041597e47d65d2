"""Dataclasses of plain values as JSON and back, arrays apart: what report_data.h5 keeps of an identification.

Numbers come back with every bit, NaN and infinity included. What type a value has is said by the dataclasses alone, so
that nothing in a file can name code.
"""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping
from functools import cache
from typing import Any, Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

AnyArray = NDArray[Any]
T = TypeVar("T")
_AT = "array"  # an array in the JSON: {"array": its number}
_PLAIN: Mapping[Any, tuple[type, ...]] = {str: (str,), bool: (bool,), int: (int,), float: (int, float)}


class CodecError(ValueError):
    """A value that does not fit the field in which it should stand; the message begins with the field's path."""


class Arrays:
    """Arrays by number; one that holds the same values as an earlier one is kept once."""

    def __init__(self) -> None:
        self.kept: list[AnyArray] = []
        self._numbers: dict[tuple[str, bytes], int] = {}

    def number(self, array: AnyArray) -> int:
        """The number under which ``array``, of any shape, is kept."""
        key = (f"{array.dtype.str}{array.shape}", array.tobytes())
        if key not in self._numbers:
            self._numbers[key] = len(self.kept)
            self.kept.append(np.ascontiguousarray(array))
        return self._numbers[key]


def encode(value: Any, arrays: Arrays) -> Any:
    """``value`` in the types of JSON, its arrays put into ``arrays``.

    Raises
    ------
    TypeError
        Where it holds something else than dataclasses, mappings, sequences, numbers, texts and arrays.
    """
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, np.ndarray):
        return {_AT: arrays.number(value)}
    if isinstance(value, np.generic):
        return encode(value.item(), arrays)
    if dataclasses.is_dataclass(value):
        return {f.name: encode(getattr(value, f.name), arrays) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): encode(item, arrays) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [encode(item, arrays) for item in value]
    raise TypeError(f"{type(value).__name__} is no plain value")


def decode(kind: type[T], value: Any, arrays: list[AnyArray]) -> T:
    """The dataclass that was encoded.

    Raises
    ------
    CodecError
        Where a value does not fit its field, or a field without a default is missing.
    """
    return cast(T, _decoded(kind, value, arrays, kind.__name__))


def _decoded(kind: Any, value: Any, arrays: list[AnyArray], where: str) -> Any:
    if dataclasses.is_dataclass(kind):
        return _dataclass(kind, value, arrays, where)
    if kind in _PLAIN:
        return _checked(isinstance(value, _PLAIN[kind]) and isinstance(value, bool) == (kind is bool), value, where)
    return value if kind is Any else _composed(kind, value, arrays, where)


def _composed(kind: Any, value: Any, arrays: list[AnyArray], where: str) -> Any:
    """Of what is written with brackets or a stroke: `tuple[float, ...]`, `Mapping[str, int]`, `float | None`."""
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        return _tuple(inner, value, arrays, where)
    if origin is np.ndarray:
        return _array(value, arrays, where)
    if origin is Literal:
        return _checked(value in inner, value, where)
    if origin in (Mapping, dict):
        _checked(isinstance(value, dict), value, where)
        return {_key(inner[0], k, where): _decoded(inner[1], v, arrays, f"{where}.{k}") for k, v in value.items()}
    (wanted,) = (one for one in inner if one is not type(None))
    return None if value is None else _decoded(wanted, value, arrays, where)


def _dataclass(kind: Any, value: Any, arrays: list[AnyArray], where: str) -> Any:
    _checked(isinstance(value, dict), value, where)
    hints, given = _hints(kind), {}
    for field in dataclasses.fields(kind):
        if field.name in value:
            given[field.name] = _decoded(hints[field.name], value[field.name], arrays, f"{where}.{field.name}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise CodecError(f"{where}.{field.name} is missing")
    return kind(**given)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return typing.get_type_hints(kind)


def _tuple(inner: tuple[Any, ...], value: Any, arrays: list[AnyArray], where: str) -> tuple[Any, ...]:
    _checked(isinstance(value, list), value, where)
    each = [inner[0]] * len(value) if len(inner) == 2 and inner[1] is Ellipsis else inner
    _checked(len(each) == len(value), value, where)
    return tuple(_decoded(k, v, arrays, f"{where}.{i}") for i, (k, v) in enumerate(zip(each, value, strict=True)))


def _array(value: Any, arrays: list[AnyArray], where: str) -> AnyArray:
    number = value.get(_AT) if isinstance(value, dict) else None
    _checked(isinstance(number, int) and 0 <= number < len(arrays), value, where)
    return arrays[cast(int, number)]


def _key(kind: Any, key: str, where: str) -> Any:
    try:
        return key if kind is str else kind(key)
    except ValueError:
        raise CodecError(f"{where}: {key[:40]!r} is no {kind.__name__}") from None


def _checked(fits: bool, value: Any, where: str) -> Any:
    if not fits:
        raise CodecError(f"{where} is {value!r:.60}")
    return value
