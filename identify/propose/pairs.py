"""Two effects that hide each other: neither explains much alone, both together nearly all.

A gap in the spring and a dead zone in the drive cancel wherever the platform follows slowly; added one at a time,
each is fitted to nothing. So where no single effect brings the model near the data, all pairs are held against the
measured motion at once: every effect at a few shapes is one group of columns of the same regression, and what a pair
of groups takes off it follows from one small solve each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from identify.estimate.initial_guess import Start
from identify.estimate.regression import Block, Regression, normal
from identify.model.parameters import Name
from identify.model.structure import Label, Shapes, Structure
from identify.propose.screening import SCREEN_STEPS, allowed, grid_of
from identify.signals.prefilter import Denominator
from identify.signals.trace import Trace
from rig import effects
from rig.effects.base import Scale
from rig.recording.run import Array

MORE = 1.25  # times what the better of the two takes away alone
LEFT = 0.5  # of what the better of the two leaves alone: the same where that is little
REFINED = 3  # of the best alone are put beside the others at their best shape, too
COLLINEAR = 1e-9


@dataclass(frozen=True)
class Pair:
    """Two effects with values to begin a fit from; ``gain`` is the share of the squares that they take away."""

    names: tuple[str, str]
    start: dict[Name, float]
    gain: float


@dataclass(frozen=True)
class _Group:
    """One effect at one shape: its columns, and what the first of them are called (the rest follow from the shape)."""

    name: str
    shape: tuple[float, ...]
    labels: tuple[Label, ...]
    columns: tuple[int, ...]


def pairs(
    traces: Sequence[Trace], structure: Structure, shapes: Shapes, start: Start, scale: Scale, names: Sequence[str],
    best_shape: Callable[[str], tuple[float, ...] | None] = lambda name: None,
) -> list[Pair]:  # fmt: skip
    """The pairs that take most away behind each of a few filters: plain ones, then those that can follow anything.

    Parameters
    ----------
    structure, shapes
        The model as it stands.
    names
        Effects that may be added.
    best_shape
        The shape between the points of its grid at which an effect alone takes most away: a gap a quarter as wide
        as the narrowest on the grid hides whatever is beside it.
    """
    rate = traces[0].channel == "rate"
    filters = [Denominator.of(*start.platform, step * start.rho, rate) for step in SCREEN_STEPS]
    grids = {n: grid_of(effects.get(n), scale) for n in names}
    middle = _Columns(traces, structure, shapes, filters[len(filters) // 2], grids)
    for name in middle.strongest()[:REFINED]:
        finer = best_shape(name) if grids[name][0] else None
        if finer is not None:
            grids[name].append(finer)
    found: dict[tuple[str, str], Pair] = {}
    for denominator in filters:
        columns = _Columns(traces, structure, shapes, denominator, grids)
        for pliant in (False, True):
            best = _best(columns, pliant)
            if best is not None and (best.names not in found or found[best.names].gain < best.gain):
                found[best.names] = best
    return sorted(found.values(), key=lambda p: (_pliant(*p.names), -p.gain))


def _pliant(*names: str) -> bool:
    return any(effects.get(n).resembles_much for n in names)


class _Columns:
    """Every effect at every shape of its grid as columns beside those of the model, start states taken out."""

    def __init__(
        self, traces: Sequence[Trace], structure: Structure, shapes: Shapes, denominator: Denominator,
        grids: Mapping[str, Sequence[tuple[float, ...]]],
    ) -> None:  # fmt: skip
        cache: dict[Any, Any] = {}
        base = Regression(traces, structure, cache)
        blocks = base.blocks(denominator, shapes)
        self.groups: list[_Group] = []
        columns: list[list[Array]] = [[b.columns] for b in blocks]
        count = len(base.labels)
        for name, grid in grids.items():
            for shape in grid:
                regression = Regression(traces, structure.plus(name), cache)
                with_it = regression.blocks(denominator, {**shapes, name: shape})
                labels = tuple(x for x in regression.labels if x not in base.labels)
                old = [regression.labels.index(x) for x in base.labels]
                own = [regression.labels.index(x) for x in labels]
                new = _added(blocks, with_it, old, own)
                width = new[0].shape[1]
                if not width:
                    continue
                self.groups.append(_Group(name, shape, labels, tuple(range(count, count + width))))
                count += width
                for kept, one in zip(columns, new, strict=True):
                    kept.append(one)
        whole = normal([replace(b, columns=np.column_stack(c)) for b, c in zip(blocks, columns, strict=True)])
        self._scale = np.sqrt(np.maximum(np.diag(whole.a), 1e-300))
        a, b, p = whole.a / np.outer(self._scale, self._scale), whole.b / self._scale, len(base.labels)
        known = np.linalg.lstsq(a[:p, :p], np.column_stack([a[:p, p:], b[:p]]), rcond=COLLINEAR)[0]
        self._first, self._known, self._base = p, known, base.labels
        self._a, self._b = a[p:, p:] - a[:p, p:].T @ known[:, :-1], b[p:] - a[:p, p:].T @ known[:, -1]
        self._left = float(whole.c - b[:p] @ known[:, -1])

    def strongest(self) -> list[str]:
        """Names of the effects, the one that takes most away alone first."""
        best: dict[str, float] = {}
        for group in self.groups:
            best[group.name] = max(best.get(group.name, 0.0), self.solved([group])[0])
        return sorted(best, key=lambda n: -best[n])

    def solved(self, groups: Sequence[_Group]) -> tuple[float, Array]:
        """Share of the squares that groups take away together, and the values of their columns."""
        at = np.array([i - self._first for g in groups for i in g.columns])
        x = np.linalg.lstsq(self._a[np.ix_(at, at)], self._b[at], rcond=COLLINEAR)[0]
        return float(self._b[at] @ x) / max(self._left, 1e-300), x / self._scale[at + self._first]

    def beside(self, groups: Sequence[_Group], x: Array) -> dict[Name, float]:
        """The model's own gains where groups have the values ``x``: what was friction is damping no more."""
        at = np.array([i - self._first for g in groups for i in g.columns])
        own = self._known[:, -1] - self._known[:, at] @ (x * self._scale[at + self._first])
        return dict(zip(self._base, (own / self._scale[: self._first]).tolist(), strict=True))


def _added(without: Sequence[Block], with_it: Sequence[Block], old: Sequence[int], own: Sequence[int]) -> list[Array]:
    """What an effect adds to every block: columns of its own, changes of the model's, a change of the torque."""
    changed = [
        k for k in range(len(old))
        if any(np.any(b.columns[:, old[k]] != a.columns[:, k]) for a, b in zip(without, with_it, strict=True))
    ]  # fmt: skip
    torque = any(np.any(a.target != b.target) for a, b in zip(without, with_it, strict=True))
    return [
        np.column_stack(
            [b.columns[:, list(own)]]
            + [b.columns[:, old[k]] - a.columns[:, k] for k in changed]
            + ([a.target - b.target] if torque else [])
        )
        for a, b in zip(without, with_it, strict=True)
    ]


def _best(columns: _Columns, pliant: bool) -> Pair | None:
    """The pair that takes most away, where that is clearly more than one of them does; bounds and signs kept.

    ``pliant`` asks for pairs in which one can follow anything, else for pairs without: those would always lose.
    """
    alone = [columns.solved([g])[0] for g in columns.groups]
    best: tuple[float, _Group, _Group, Array] | None = None
    for (i, one), (k, other) in combinations(enumerate(columns.groups), 2):
        if one.name == other.name or _pliant(one.name, other.name) != pliant:
            continue
        gain, x = columns.solved([one, other])
        one_alone = max(alone[i], alone[k])
        more = gain > MORE * one_alone or 1.0 - gain < LEFT * (1.0 - one_alone)
        if (best is None or gain > best[0]) and more:
            values = dict(zip((*one.labels, *other.labels), _of(one, other, x), strict=True))
            if allowed(values, one.name) and allowed(values, other.name):
                best = gain, one, other, x
    if best is None:
        return None
    gain, one, other, x = best
    start: dict[Name, float] = dict(zip((*one.labels, *other.labels), _of(one, other, x), strict=True))
    own = columns.beside([one, other], x)
    if own.get(("inertia",), 1.0) > 0.0 and own.get(("stiffness",), 0.0) >= 0.0:
        start = {n: v for n, v in own.items() if len(n) == 1} | start
    return Pair((one.name, other.name), {**start, **_shapes(one), **_shapes(other)}, gain)


def _of(one: _Group, other: _Group, x: Array) -> list[float]:
    """The gains of both effects among the values of their columns."""
    n = len(one.columns)
    return [float(v) for v in (*x[: len(one.labels)], *x[n : n + len(other.labels)])]


def _shapes(group: _Group) -> Mapping[Name, float]:
    shaped = [p.name for p in effects.get(group.name).parameters if not p.linear]
    return {(group.name, p): v for p, v in zip(shaped, group.shape, strict=True)}
