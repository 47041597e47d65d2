"""Least squares in torque along the measured motion: what a model explains in the band that matters (Eq. 8-10).

Torque, motion and the torque of every effect pass one zero-phase low-pass; what is left of the torque is the
disturbance and, in its upper part, the sensor's noise. On measured data, where a disturbance is far larger than what
the sensor adds, this is nearly the maximum-likelihood estimate, it is linear, and what it leaves is in newton metres.
The residual is coloured: its likelihood is that of an autoregression fitted beside the parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from identify.diagnose.coloured_residual import bounded, coloured_cost, combined, lines, rms, standard_errors, strongest
from identify.diagnose.low_passed_torque import LowPassedTorque
from identify.diagnose.terms.free_form import FreeForm
from identify.diagnose.torque_fit import TorqueFit
from identify.model.effect_torque import feeds_on_torque
from identify.model.parameters import Name
from identify.model.structure import Shapes, Structure
from rig import effects
from rig.arrays import Array

# Samples behind the low-pass in a block, and how many blocks.
BLOCK_SAMPLES, BLOCKS_A_RUN, MIN_HELD_OUT_BLOCKS = 8, 24, 8
LEAST_PASSED_ON = 1e6  # times: a drive that passes on less passes on nothing
MIN_FOR_LINES, MIN_TRAVEL_RAD = 64, 0.5  # samples, and travel to show a line against the angle


class _Stacked(NamedTuple):
    """All runs one below the other: columns, (n, p + extra), the torque, (n,), names of the first p columns.

    Behind those stand ``extra`` columns of what is free in each run.
    """

    columns: Array
    target: Array
    names: list[Name]
    extra: int


class TorqueRegression(LowPassedTorque):
    """Fits structures in torque over a set of runs."""

    def beside(self, fit: TorqueFit, term: FreeForm) -> tuple[TorqueFit, Array, float]:
        """A model fitted together with a free-form term, the term's gains, and the penalty on its roughness.

        Of several penalties that which leaves least on held-out samples. Of a term of each run by itself, blocks of
        every run are held out instead of whole runs.
        """
        a, y, names, extra = self._over_all_runs(fit.structure, fit.shapes)
        wide = np.column_stack([a, term.columns])
        low = np.array([self._low(n) for n in names] + [-np.inf] * (wide.shape[1] - len(names)))
        own = np.arange(wide.shape[1])
        free = (own >= len(names)) & (own < a.shape[1])
        folds = self._by_block if term.of_each_run else self._folds(names, extra)
        curve = None if term.over is None else (term.over, own >= a.shape[1])
        sums = self._sums(wide, y, folds)
        tried = []
        for penalty in term.penalties:
            ridge = np.concatenate([np.zeros(a.shape[1]), term.ridge(penalty)])
            tried.append((*self._with_folds(wide, y, low, folds, free, sums, ridge, curve), penalty))
        x, held, penalty = min(tried, key=lambda one: self._left(fit, term, names, a, y, *one[:2])[0])
        _, scale = self._left(fit, term, names, a, y, x, held)
        r, held = scale * (y - wide @ x), scale * held
        ends = np.cumsum([len(rows) for rows in self._rows])[:-1]
        values = {**fit.values, **dict(zip(names, x[: len(names)].tolist(), strict=True))}
        return replace(
            fit, vector=np.array([values[n] for n in fit.names]), variance=rms(r[self._fitted]) ** 2,
            held_nm=rms(held[self._judged]), residuals=np.split(r, ends), held=np.split(held, ends),
        ), x[a.shape[1] :], penalty  # fmt: skip

    def _left(
        self, fit: TorqueFit, term: FreeForm, names: Sequence[Name], a: Array, y: Array, x: Array, held: Array
    ) -> tuple[float, float]:  # fmt: skip
        """What is left on held-out samples beside a term, N m, and by how much more than its size it counts."""
        scale = self._passed_on(y - self._taken(names, x[: a.shape[1]], a))
        if term.on == "torque":  # a friction and a curve explain any torque: what of it sets in motion has to be kept
            moves = [k for k, n in enumerate(names) if len(n) == 1]
            was, now = (rms(a[:, moves] @ v) for v in ([fit.values[names[k]] for k in moves], x[moves]))
            scale *= min(max(was / max(now, 1e-300), 1.0), LEAST_PASSED_ON)
        return scale * rms(held[self._judged]), scale

    def columns_of(self, fit: TorqueFit) -> tuple[dict[Name, Array], Array]:
        """The column of every linear parameter over all runs, (n,) each, and what is free in each run, (n, m)."""
        a, _, names, _ = self._over_all_runs(fit.structure, fit.shapes)
        return {name: a[:, k] for k, name in enumerate(names)}, a[:, len(names) :]

    def covariance_beside(self, richer: TorqueFit, columns: Array) -> tuple[list[Name], Array]:
        """Names of a model's linear parameters, and the covariance of these and of the gains of further columns."""
        a, _, names, _ = self._over_all_runs(richer.structure, richer.shapes)
        wide = np.column_stack([a, columns])[self._fitted]
        size = np.sqrt(np.maximum(np.sum(wide * wide, axis=0), 1e-300))
        inverse = np.linalg.pinv((wide / size).T @ (wide / size)) / np.outer(size, size)
        kept = np.r_[: len(names), a.shape[1] : wide.shape[1]]
        return names, richer.variance * inverse[np.ix_(kept, kept)]

    def _folds(self, names: Sequence[Name], extra: int) -> list[Any]:
        """Samples held out in turn: whole runs, unless something is fitted for every run."""
        return self._by_block if extra or any(len(n) == 3 for n in names) else self._by_run

    def _with_folds(
        self, a: Array, y: Array, low: Array, folds: Sequence[Any], free: Any,
        sums: Sequence[tuple[Array, Array]], ridge: Any = 0.0, curve: tuple[Array, Any] | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Least squares from their ``sums``, and the residual where every fold was left out of its own fit.

        What is ``free`` in each run, (columns,) boolean, is no part of the model: it is fitted to held-out samples too.
        A ``curve``, its quantity, (n,), and its columns, (columns,) boolean, says nothing about values it has not seen.
        """

        fitted, *rests = [bounded(square + np.diag(np.broadcast_to(ridge, a.shape[1])), of, low) for square, of in sums]
        held = y - a @ fitted
        used = self._used
        for fold, gains in zip(folds, rests, strict=True):
            rest = used & ~fold
            left = y - a[:, ~free] @ gains[~free]
            if curve is not None:
                over, its = curve
                unseen = (over < np.min(over[rest], initial=np.inf)) | (over > np.max(over[rest], initial=-np.inf))
                left[unseen] += a[np.ix_(unseen, its)] @ gains[its]
            if np.any(free):
                own = a[used][:, free]
                left = left - a[:, free] @ bounded(own.T @ own, own.T @ left[used], np.full(own.shape[1], -np.inf))
            held[fold] = left[fold]
        return fitted, held

    def _sums(self, a: Array, y: Array, folds: Sequence[Any]) -> list[tuple[Array, Array]]:
        """Normal equations of the samples that fit, and of those without each fold."""
        every = [self._fitted, *(self._used & ~fold for fold in folds)]
        return [(a[rows].T @ a[rows], a[rows].T @ y[rows]) for rows in every]

    def left_by(self, structure: Structure, values: Mapping[Name, float]) -> float:
        """Root mean square residual at given parameters, biases fitted, N m."""
        columns, residuals, _ = self.linear_parts(structure, values)
        return rms(np.concatenate(residuals)) if columns else float("nan")

    def linear_parts(
        self, structure: Structure, values: Mapping[Name, float]
    ) -> tuple[list[Array], list[Array], list[Name]]:  # fmt: skip
        """Columns and residual of every run at given parameters, biases projected out, and the columns' names."""
        shapes = structure.shapes_of(values)
        parts = [self._columns(i, structure, shapes) for i in range(len(self.traces))]
        names: list[Name] = list(dict.fromkeys(n for _, own, _ in parts for n in own))
        used = np.split(self._used, np.cumsum([len(r) for r in self._rows])[:-1])
        columns, residuals = [], []
        for (a, own, y), rows in zip(parts, used, strict=True):
            wide = np.zeros((len(y), len(names)))
            wide[:, [names.index(n) for n in own]] = a[:, : len(own)]
            r = y - wide @ np.array([values.get(n, 0.0) for n in names])
            free = a[:, len(own) :]
            both = np.column_stack([wide, r])[rows]
            if free.shape[1]:
                q = np.linalg.qr(free[rows])[0]
                both = both - q @ (q.T @ both)
            columns.append(both[:, :-1])
            residuals.append(both[:, -1])
        return columns, residuals, names

    def stacked(self, structure: Structure, shapes: Shapes) -> tuple[Array, Array, list[Name]]:
        """Columns of a structure over all runs, what is free in each run behind them, target and names; as fitted."""
        all_ = self._over_all_runs(structure, shapes)
        return all_.columns[self._fitted], all_.target[self._fitted], all_.names

    def own_columns(self, name: str, shape: tuple[float, ...]) -> Array:
        """Columns of one effect alone, one a gain, or one a gain and run where every run has its own; as fitted."""
        parts = [
            self._columns(i, Structure((), (name,)), {name: shape})[:2] for i in range(len(self.traces))
        ]  # fmt: skip
        names: list[Name] = list(dict.fromkeys(n for _, own in parts for n in own))
        out = []
        for a, own in parts:
            full = np.zeros((len(a), len(names)))
            full[:, [names.index(n) for n in own]] = a[:, : len(own)]
            out.append(full)
        return np.concatenate(out)[self._fitted]

    def _over_all_runs(self, structure: Structure, shapes: Shapes) -> _Stacked:
        parts = [self._columns(i, structure, shapes) for i in range(len(self.traces))]
        names: list[Name] = list(dict.fromkeys(n for _, own, _ in parts for n in own))
        extra = sum(a.shape[1] - len(own) for a, own, _ in parts)
        wide, at = [], len(names)
        for a, own, y in parts:
            full = np.zeros((len(y), len(names) + extra))
            full[:, [names.index(n) for n in own]] = a[:, : len(own)]
            more = a.shape[1] - len(own)
            full[:, at : at + more] = a[:, len(own) :]
            at += more
            wide.append(full)
        return _Stacked(np.concatenate(wide), np.concatenate([y for _, _, y in parts]), names, extra)

    def solve(self, structure: Structure, shapes: Shapes, filters: Array | None = None) -> TorqueFit:
        """One structure at given shapes; gains within their bounds.

        ``filters`` is an autoregression of the residual from elsewhere, for the cost; it is the fit's own where None.
        """
        a, y, names, extra = self._over_all_runs(structure, shapes)
        low = np.array([self._low(n) for n in names] + [-np.inf] * extra)
        used, fitting = self._used, self._fitted
        own = np.arange(a.shape[1]) >= len(names)
        folds = self._folds(names, extra)
        sums = self._sums(a, y, folds)
        x, held = self._with_folds(a, y, low, folds, own, sums)
        normal = sums[0][0]
        r = y - a @ x
        # A drive that passes on little of the torque leaves little of it unexplained: what counts is the share.
        scale = self._passed_on(y - self._taken(names, x, a))
        r, held = scale * r, scale * held
        values = dict(zip(names, x[: len(names)].tolist(), strict=True))
        for name in structure.effects:
            shape_names = [p.name for p in effects.get(name).parameters if not p.linear]
            values |= {(name, k): v for k, v in zip(shape_names, shapes.get(name, ()), strict=True)}
        ends = np.cumsum([len(r) for r in self._rows])[:-1]
        run = np.concatenate([np.full(len(r), i) for i, r in enumerate(self._rows)])
        cost, filters = coloured_cost(scale * a[used], scale * y[used], run[used], x, filters)
        cross = normal[np.ix_(~own, own)]
        linear = scale**2 * (normal[np.ix_(~own, ~own)] - cross @ np.linalg.pinv(normal[np.ix_(own, own)]) @ cross.T)
        information = block_diag(linear, np.zeros((len(values) - len(names),) * 2))
        return TorqueFit(
            structure, tuple(values), np.array(list(values.values())), int(used.sum()), rms(r[fitting]) ** 2, cost,
            information, rms(held[self._judged]), np.split(r, ends), np.split(held, ends), filters,
        )  # fmt: skip

    def _passed_on(self, torque: Array) -> float:
        """How many times what a drive passes on the recorded torque is: of what it leaves, the share counts."""
        return float(min(self.torque_nm / max(rms(torque), 1e-300), LEAST_PASSED_ON))

    @staticmethod
    def _taken(names: Sequence[Name], x: Array, a: Array) -> Array:
        """What effects that feed on the torque itself take of it, (n,)."""
        mine = [k for k, n in enumerate(names) if len(n) > 1 and feeds_on_torque(n[0])]
        return np.asarray(a[:, mine] @ x[mine]) if mine else np.zeros(len(a))

    @staticmethod
    def _low(name: Name) -> float:
        if len(name) == 1:
            return 0.0 if name[0] == "inertia" else -np.inf
        return next(p for p in effects.get(name[0]).parameters if p.name == name[1]).low

    def lines(self, fit: TorqueFit) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The strongest lines of a residual: over time in Hz, and over the angle in periods a turn."""
        hz: list[tuple[float, float]] = []
        orders: list[tuple[float, float]] = []
        for i, (t, r) in enumerate(zip(self.traces, fit.residuals, strict=True)):
            if len(r) < MIN_FOR_LINES:
                continue
            time = self._rows[i] * t.step_s
            hz += lines(time, r, self.cutoff_hz)
            angle = self._motion[i][0]
            travel = float(np.ptp(angle))
            if travel > MIN_TRAVEL_RAD:
                ordered = np.argsort(angle)
                most = min(400.0, 0.2 * len(r) / travel * 2.0 * np.pi)
                orders += [
                    (size, 2.0 * np.pi * f) for size, f in lines(angle[ordered], r[ordered], most / (2.0 * np.pi))
                ]
        return strongest(hz), strongest(orders)

    def fall_in_sigmas(self, base: TorqueFit, richer: TorqueFit, of_each_run: bool = False) -> tuple[float, float]:
        """Standard errors by which the squared residual on held-out samples is lower, block by block.

        Of the falls, and of the falls of their logarithms: a few blocks with all of the torque must not hide that all
        others gain. Of what is fitted to each run by itself, a run that knows little of it must not hide that others
        do: the error rates of all runs are combined (Fisher 1925).
        """
        by_run = [falls for falls in self._falls(base, richer) if len(falls[0])]
        if sum(len(fall) for fall, _ in by_run) < MIN_HELD_OUT_BLOCKS:
            return 0.0, 0.0
        fall, ratio = zip(*by_run, strict=True)
        if np.mean(np.concatenate(fall)) <= 0.0:
            return 0.0, 0.0
        if of_each_run:
            return combined(fall), combined(ratio)
        return standard_errors(np.concatenate(fall)), standard_errors(np.concatenate(ratio))

    def _falls(self, base: TorqueFit, richer: TorqueFit) -> list[tuple[Array, Array]]:
        """Falls of the squared residual on held-out samples and of its logarithm in the blocks of every run."""
        out = []
        ends = np.cumsum([len(r) for r in self._rows])[:-1]
        for old, new, judged in zip(base.held, richer.held, np.split(self._judged, ends), strict=True):
            before, after = old[judged] ** 2, new[judged] ** 2
            count = max(1, min(BLOCKS_A_RUN, len(before) // BLOCK_SAMPLES)) if len(before) else 0
            pairs = zip(np.array_split(before, count), np.array_split(after, count), strict=True) if count else ()
            powers = np.array([(np.mean(x), np.mean(y)) for x, y in pairs]).reshape(-1, 2)
            logs = np.log(np.maximum(powers, 1e-300))
            out.append((powers[:, 0] - powers[:, 1], logs[:, 0] - logs[:, 1]))
        return out

    def evidence(self, base: TorqueFit, richer: TorqueFit) -> float:
        """Fall of the penalised cost, the residual's colour taken from either model, whichever does better."""
        behind = self.solve(richer.structure, richer.shapes, base.filters)
        return base.penalised - min(richer.penalised, behind.penalised)
