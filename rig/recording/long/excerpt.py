"""A long recording made a run of a stated number of samples: low-passed and decimated as far as its motion allows.

What is still too long is cut to the span in which inertia, damping, stiffness and dry friction are best told apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from rig.arrays import Array
from rig.decimation import REACH, SAMPLES_A_PERIOD, SPAN_STARTS, keeps_white
from rig.recording.long.blocks import BLOCK_ROWS
from rig.recording.long.laying import Decimating, Laying, Uneven
from rig.recording.long.scan import Scan, scan
from rig.recording.run import Excerpt

HELD = np.array([-1.0, 13.0, 13.0, -1.0]) / 24.0  # of the values held from two steps before to one after an instant
Rows = Callable[[int, int], Mapping[str, Array]]


@dataclass(frozen=True)
class Taken:
    """Columns of the run by name ("time", "valid", "rate", ...), and how they came about."""

    columns: Mapping[str, Array]
    excerpt: Excerpt


def take(rows: Rows, first: int, last: int, most: int, *, held: bool) -> Taken:
    """About ``most`` samples at most, out of rows first..last (excluded).

    Parameters
    ----------
    rows
        Gives columns of some rows in SI units: "time", "valid", "rate" or "angle", "torque", "channel NAME".
    held
        Whether every torque was held until the next.
    """
    channel = "rate" if "rate" in rows(first, first + 1) else "angle"
    seen = scan(_blocks(rows, first, last), channel)
    factor = _factor(seen, last - first, most)
    count = min(last - first, (most + 2 * REACH) * factor if factor > 1 else most)
    places = np.unique(
        np.linspace(first, last - count, SPAN_STARTS if count < last - first else 1).astype(int)
    ).tolist()
    best: dict[str, Array] = {}
    most_told, scale = -np.inf, None
    for at in places:
        columns = _decimated(_blocks(rows, at, at + count), seen, factor, held)
        if len(columns["time"]) < 2:
            continue
        told, scale = _told(columns, channel, seen.mean, scale)
        if told > most_told or not best:
            best, most_told = columns, told
    if not best:  # a hole in every place: then as it is
        factor, best = 1, _joined(_blocks(rows, first, min(last, first + most)))
    time, start = best["time"], next(_blocks(rows, first, last))["time"]
    cut = Excerpt(last - first, factor, float(time[0]), float(time[-1]), float(start[0]), count == last - first)
    return Taken(best, cut)


def _blocks(rows: Rows, first: int, last: int) -> Iterator[Mapping[str, Array]]:
    for at in range(first, last, BLOCK_ROWS):
        block = rows(at, min(at + BLOCK_ROWS, last))
        there = np.isfinite(block["time"])  # a lost sample may have lost its time too
        if there.any():
            yield block if there.all() else {name: values[there] for name, values in block.items()}


def _factor(seen: Scan, count: int, most: int) -> int:
    if not seen.even:
        return 1
    slowest_hz = 1.0 / (SAMPLES_A_PERIOD * seen.step_s)
    return max(1, min(int(slowest_hz / seen.bandwidth_hz), -(-count // most)))


def _joined(blocks: Iterator[Mapping[str, Array]]) -> dict[str, Array]:
    parts = list(blocks)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]} if parts else {}


def _decimated(blocks: Iterator[Mapping[str, Array]], seen: Scan, factor: int, held: bool) -> dict[str, Array]:
    """A span of rows at its new rate; empty where it has a hole."""
    if factor == 1:
        return _joined(blocks)
    laying = Laying(seen.step_s)
    passing: Decimating | None = None
    parts: list[dict[str, Array]] = []
    for block in blocks:
        try:
            laid = laying.lay(block)
        except Uneven:
            return {"time": np.zeros(0)}
        for name in [name for name in laid if name.startswith("channel ")]:
            laid[f"{name} known"] = np.isfinite(laid[name]).astype(float)
            laid[name] = np.nan_to_num(laid[name])
        passing = passing or Decimating(factor, {name: _weights(name, factor, held) for name in laid})
        parts.append(passing.pass_on(laid))
    if passing is None or laying.first_s is None:
        return {"time": np.zeros(0)}
    out = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    step_s = (laying.last_s - laying.first_s) / max(laying.count - 1, 1)
    out["time"] = laying.first_s + step_s * (passing.reach + factor * np.arange(len(out["bad"])))
    out["valid"] = (out.pop("bad") < 0.5).astype(float)
    for name in [name for name in out if name.endswith(" known")]:
        known = out.pop(name)
        with np.errstate(all="ignore"):
            out[name.removesuffix(" known")] = np.where(known > 0.5, out[name.removesuffix(" known")] / known, np.nan)
    return out


def _weights(name: str, factor: int, held: bool) -> Array:
    """Of a sample's neighbours, odd in number. Of flags, their sum over those that the low-pass mostly weighs."""
    if name == "bad":
        return np.ones(2 * factor + 1)
    if name.startswith("channel "):
        return np.ones(2 * (factor // 2) + 1)
    low_pass = keeps_white(factor)
    if name == "torque" and held:
        # Over the step before an instant one value is held, over the step behind it the next: their mean is what acts
        # about the instant, and with the weights of the neighbours that holds up to the fourth order.
        return np.append(np.convolve(low_pass, HELD), 0.0)
    return low_pass


def _told(
    columns: Mapping[str, Array], channel: str, mean: float, scale: tuple[Array, float] | None
) -> tuple[float, tuple[Array, float]]:  # fmt: skip
    """How well a span tells the terms of a platform apart, on the ``scale`` of the first that was looked at."""
    step_s = float(np.median(np.diff(columns["time"])))
    if channel == "rate":
        rate = columns["rate"] - (0.0 if "angle" in columns else mean)
        angle = columns["angle"] if "angle" in columns else step_s * np.cumsum(rate)
    else:
        angle = columns["angle"]
        rate = np.gradient(angle, step_s)
    slow = scale[1] if scale else 0.02 * float(np.max(np.abs(rate))) + 1e-300
    terms = [np.gradient(rate, step_s), rate, angle - np.mean(angle), np.tanh(rate / slow), np.ones(len(rate))]
    table = np.nan_to_num(np.stack(terms, axis=1))
    size = scale[0] if scale else np.sqrt(np.mean(table**2, axis=0)) + 1e-300
    table = table / size
    return float(np.linalg.slogdet(1e-6 * np.eye(len(terms)) + table.T @ table / len(table))[1]), (size, slow)
