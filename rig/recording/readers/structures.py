"""What MATLAB, Simulink and dSPACE keep in structs, as columns: a struct's fields are called `struct.field`.

Known besides are Simulink's structure with time, what a timeseries and a Dataset become as structs, a struct a row, and
the captures of dSPACE's ControlDesk. Signals of several rates stand at the times of the slowest measurement.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rig.recording.rasters import Group, at_times_of, base_of
from rig.recording.readers.matrices import column_of, is_matrix, labels_for, names_of

MIN_RECORDS = 10  # structs of an array that are rows


@dataclass(frozen=True)
class Struct:
    """A struct, or an array of them: field -> value of each."""

    elements: tuple[dict[str, Any], ...]


@dataclass(frozen=True)
class Unknown:
    """What cannot be a column, as the end of a sentence with a cure."""

    why: str


@dataclass
class Found:
    """Columns as they are found; ``groups`` are those that are sampled at times of their own, by the time's name."""

    columns: dict[str, Any] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    groups: list[tuple[str, Group]] = field(default_factory=list)

    def free(self, *names: str) -> str:
        """The first of the names that no column has yet."""
        taken = {**self.columns, **{n: None for _, g in self.groups for n in g.columns}}
        numbered = (f"{names[-1]}_{i}" for i in range(2, len(taken) + 3))
        return next(name for name in (*names, *numbered) if name and name not in taken)


def columns_of(variables: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """Column -> values (or Unknown) and column -> unit of the variables of a file.

    A value is an array, a text, a list (a cell array), a Struct or Unknown.
    """
    found = Found()
    _walk("", variables, found)
    _lay(found)
    return found.columns, found.units


def _walk(prefix: str, fields: Mapping[str, Any], found: Found) -> None:
    for kind in (_structure_with_time, _timeseries, _capture, _dataset):
        if kind(prefix, fields, found):
            return
    texts = list(_texts(fields))
    for name, value in fields.items():
        full = f"{prefix}.{name}" if prefix else name
        if isinstance(value, Struct):
            _struct(full, value, found)
        elif isinstance(value, np.ndarray) and is_matrix(value.shape):
            found.columns[full] = value  # said to be none if somebody wants it: it may be the torque by its name
            names = names_of(full, value.shape, labels_for(min(value.shape), texts), matlab=True)
            for i, column in enumerate(names):
                found.columns[found.free(column, f"{full}.{column}")] = column_of(value, i)
        elif not (isinstance(value, str) or any(value is text for text in texts)):
            found.columns[full] = Unknown("is a cell array: save it as an array") if isinstance(value, list) else value


def _struct(name: str, value: Struct, found: Found) -> None:
    rows = value.elements
    if len(rows) == 1:
        _walk(name, rows[0], found)
    elif len(rows) >= MIN_RECORDS and all(_is_number(v) for row in rows for v in row.values()):
        # table2struct makes a struct of every row.
        for key in rows[0]:
            found.columns[f"{name}.{key}"] = np.array([float(np.ravel(row[key])[0]) for row in rows])
    else:
        found.columns[name] = Unknown(f"is an array of {len(rows)} structs: save the numbers in them as arrays")


def _structure_with_time(prefix: str, fields: Mapping[str, Any], found: Found) -> bool:
    """What scopes and To Workspace of Simulink save: time, and signals with values and label."""
    time, signals = _vector(fields.get("time")), fields.get("signals")
    if time is None or not isinstance(signals, Struct) or not all("values" in one for one in signals.elements):
        return False
    columns: dict[str, Any] = {}
    for i, one in enumerate(signals.elements):
        place = f"{prefix}.signals.values" if len(signals.elements) == 1 else f"{prefix}.signals({i + 1}).values"
        label = next((text for key in ("label", "title") if (text := _text(one.get(key)))), "")
        parts = _at_times(place, one["values"], len(time))
        names = [text.strip() for text in label.split(",")]
        if len(parts) > 1 and len(names) == len(parts) and all(names):
            parts = dict(zip(names, parts.values(), strict=True))
        elif len(parts) == 1 and label:
            parts = {label: next(iter(parts.values()))}
        for name, values in parts.items():
            columns[found.free(*([] if name in columns else [name]), f"{place} {name}")] = values
    found.groups.append((f"{prefix}.time", Group(prefix, time, columns)))
    return bool(columns)


def _timeseries(prefix: str, fields: Mapping[str, Any], found: Found) -> bool:
    """A timeseries that was made a struct: Time, Data, and the unit in DataInfo."""
    time = _vector(fields.get("Time"))
    if time is None or not isinstance(fields.get("Data"), np.ndarray):
        return False
    columns = _at_times(f"{prefix}.Data", fields["Data"], len(time))
    unit = _text(_first(fields.get("DataInfo")).get("Units"))
    found.groups.append((f"{prefix}.Time", Group(prefix, time, columns, dict.fromkeys(columns, unit) if unit else {})))
    return True


def _dataset(prefix: str, fields: Mapping[str, Any], found: Found) -> bool:
    """A Simulink Dataset that was made a struct: elements with Name and Values, in a cell or an array of structs."""
    key = next((k for k in ("Element", "Elements", "elements", "Storage_") if k in fields), None)
    kept = fields.get(key) if key else None
    elements = [e for c in kept for e in _each(c)] if isinstance(kept, list) else list(_each(kept))
    if not elements or not all("Values" in e for e in elements):
        return False
    for i, element in enumerate(elements):
        name = _text(element.get("Name")) or f"{prefix}.{key}({i + 1})"
        _walk(found.free(name, f"{prefix}.{name}"), _first(element["Values"]), found)
    return True


def _capture(prefix: str, fields: Mapping[str, Any], found: Found) -> bool:
    """A capture of dSPACE's ControlDesk: X has the times of the rasters, Y names, units and values of the signals."""
    rasters, signals = list(_each(fields.get("X"))), list(_each(fields.get("Y")))
    if not rasters or not signals or not all("Data" in one for one in (*rasters, *signals)):
        return False
    for i, raster in enumerate(rasters):
        time = _vector(raster["Data"])
        if time is None:
            continue
        columns, units = dict[str, Any](), dict[str, str]()
        for signal in signals:
            if _raster_of(signal, rasters) != i:
                continue
            name, path = _text(signal.get("Name")).strip("\"'{}"), _text(signal.get("Path")).strip("\"'{}")
            wanted = [n for n in (name, f"{path}/{name}") if n and n not in columns]
            column = found.free(*wanted, f"{prefix}.Y.{name}")
            columns[column] = np.ravel(signal["Data"])
            if unit := _text(signal.get("Unit")):
                units[column] = unit
        time_name = found.free(_text(raster.get("Name")), "time") if i == 0 else f"{prefix}.X({i + 1}).Data"
        found.units[time_name] = _text(raster.get("Unit")) or "s"
        found.groups.append((time_name, Group(prefix, time, columns, units)))
    return True


def _raster_of(signal: Mapping[str, Any], rasters: Sequence[Mapping[str, Any]]) -> int:
    """Which of the rasters a signal has: by its index, else by its name, else the first that is as long."""
    index, name = _vector(signal.get("XIndex")), _text(signal.get("Raster"))
    if index is not None and len(index) == 1 and 1 <= index[0] <= len(rasters):
        return int(index[0]) - 1
    named = [i for i, raster in enumerate(rasters) if name and _text(raster.get("Raster")) == name]
    length = np.size(signal["Data"])
    return next(iter([*named, *(i for i, raster in enumerate(rasters) if np.size(raster["Data"]) == length)]), 0)


def _lay(found: Found) -> None:
    """The columns of all groups at the times of one of them; a group of the same times keeps its own time."""
    if not found.groups:
        return
    base = base_of([group for _, group in found.groups]) or found.groups[0][1]
    loose, found.columns = found.columns, {}
    for time_name, group in sorted(found.groups, key=lambda one: one[1] is not base):
        if group is base or group.has_times_of(base):
            found.columns[found.free(time_name)] = group.time_s
    for _, group in found.groups:
        for name, values in group.columns.items():
            found.columns[name] = at_times_of(base, group, np.asarray(values))
        found.units |= group.units
    found.columns |= {name: values for name, values in loose.items() if name not in found.columns}


def _at_times(name: str, values: Any, count: int) -> dict[str, Any]:
    """The columns of a signal, of which the samples may run along the first dimension or the last."""
    if not isinstance(values, np.ndarray) or values.ndim < 2 or values.size in (0, count):
        return {name: np.ravel(values) if isinstance(values, np.ndarray) else Unknown("holds no numbers: save numbers")}
    if values.shape[-1] == count and (values.ndim > 2 or values.shape[0] != count):
        values = values.reshape(-1, count).T
    elif values.shape[0] == count:
        values = values.reshape(count, -1)
    else:
        return {name: np.ravel(values)}
    return {f"{name}(:,{i + 1})": column for i, column in enumerate(values.T)}


def _texts(fields: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    """Lists of texts among the fields: what may be the names of a matrix's columns."""
    for value in fields.values():
        if isinstance(value, list) and value and all(isinstance(text, str) for text in value):
            yield value


def _text(value: Any) -> str:
    """A text, or that of a unit that is a struct with a Name; empty for anything else."""
    if isinstance(value, Struct):
        value = _first(value).get("Name")
    return value.strip() if isinstance(value, str) else ""


def _first(value: Any) -> Mapping[str, Any]:
    return next(_each(value), {})


def _each(value: Any) -> Iterator[dict[str, Any]]:
    yield from value.elements if isinstance(value, Struct) else ()


def _vector(value: Any) -> Any:
    """An array of one dimension as (n,), None for anything else."""
    is_one = isinstance(value, np.ndarray) and value.size > 0 and value.size == max(value.shape, default=0)
    return np.ravel(value).astype(float) if is_one and value.dtype.kind in "fiu" else None


def _is_number(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.size == 1 and value.dtype.kind in "fiub"
