"""Runs of which one got another torque than was recorded, or at another moment: no effect of the platform.

Between runs that each hold a tone of their own, a gain that is a percent off in one looks like a platform that follows
one frequency more than another: a mode far above all excitation follows that to the noise, with J half of what it is.
So what was named is held against a torque of some runs that is a little larger or later, and against as few of those
as it takes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from identify.estimate.output_error import OutputErrorFit, refine
from identify.model.parameter_fit import reduced_chi_square
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.rivals.whole_runs import TOLERANCE, WHOLE_RUN_STEPS, FreeRunFitter
from identify.signals.trace import Trace
from identify.simulate.sensitivities import sensitivities
from identify.wording import joined, number
from rig.dynamics import TorqueSignal
from rig.platform import TERMS
from rig.recording.run import Array

# Of the excess over the noise, that changes of single runs have to be foretold to explain.
EXPLAINED_SHARE = 0.95
RUNS_AT_NOISE = 1.05  # reduced chi-square: the noise is known to a percent or two
AT_FLOOR = 1.1  # the same: what is there has found what there is
RUN_CHANGE_ROUNDS = 3  # the change is small, but not infinitely so
MAX_GAIN_CHANGE = 0.3  # of the torque; a run that differs by more is another campaign
LATEST_S = 0.05  # largest delay of one run


class Change(NamedTuple):
    """What one run's torque was instead of the recorded one: ``size`` larger, relative, or later, in s."""

    run: int  # among the traces that are fitted
    kind: Literal["gain", "delay"]
    size: float


@dataclass(frozen=True)
class Heterogeneity:
    """Changes of a few runs' torque with which the declared model reaches the noise.

    Attributes
    ----------
    changes
        Run name, kind and size.
    penalised
        Chi square and the penalty for parameters.
    """

    changes: tuple[tuple[str, str, float], ...]
    penalised: float


def heterogeneity_of(fits: FreeRunFitter, declared: Structure, start: Mapping[Name, float]) -> Heterogeneity | None:
    """The few runs whose torque, a little larger or later, would explain all that the declared model leaves.

    None where there is nothing to explain, or where that does not do it.
    """
    moved = [i for i, t in enumerate(fits.fitting) if t.torque is not None]
    if len(moved) < 2 or not set(TERMS[:1]) <= set(declared.terms):
        return None
    base = fits.fitted(declared, start)
    if base is None or base.reduced_chi_square < RUNS_AT_NOISE:
        return None
    chosen = _predicted_changes(fits, base)
    if not chosen or len({c.run for c in chosen}) == len(moved):
        return None  # of all runs alike it would be an effect
    traces, fit, total = fits.fitting, base, dict.fromkeys([(c.run, c.kind) for c in chosen], 0.0)
    for _ in range(RUN_CHANGE_ROUNDS):
        rests, columns = _columns(fit, fits.use)
        wanted = [_items(len(fits.fitting)).index(key) for key in total]
        step = _solved(np.column_stack([columns[0], columns[1][:, wanted]]), rests)[columns[0].shape[1] :]
        total = {key: value + float(d) for (key, value), d in zip(total.items(), step, strict=True)}
        if any(abs(v) > (MAX_GAIN_CHANGE if kind == "gain" else LATEST_S) for (_, kind), v in total.items()):
            return None
        traces = [_changed(t, i, total) for i, t in enumerate(fits.fitting)]
        before = fit.sigma
        fit = refine(
            traces, declared, fit.values, None, WHOLE_RUN_STEPS, fits.use, fit.shots, fits.fixed, TOLERANCE, coarse=True
        )  # fmt: skip
        if not fit.sigma < 0.999 * before:
            break
    if not reduced_chi_square(fit.sigma, fits.noise) < AT_FLOOR:
        return None
    squares = fit.sigma**2 * fit.count / fits.noise**2
    penalty = (len(fit.names) + len(total)) * float(np.log(max(fit.count, 2)))
    named = tuple((fits.fitting[i].run.name, kind, v) for (i, kind), v in total.items())
    return Heterogeneity(named, squares + penalty)


def explains_as_much(apart: Heterogeneity, named: OutputErrorFit) -> bool:
    """Whether another torque in some runs is likelier than the effects of a model."""
    return apart.penalised < named.penalised


def describe(apart: Heterogeneity, linear: bool) -> tuple[str, str]:
    """What would explain it all, in words, and what would tell."""
    what = "force" if linear else "torque"
    parts = [
        f"{'larger' if size > 0 else 'smaller'} by {number(abs(100.0 * size), 2)} % in {run}"
        if kind == "gain"
        else f"{number(abs(1e3 * size), 2)} ms {'later' if size > 0 else 'earlier'} in {run}"
        for run, kind, size in apart.changes
    ]
    runs = joined(list(dict.fromkeys(run for run, _, _ in apart.changes)))
    return (
        f"The runs disagree with each other, and no effect of the platform is needed to explain it: a {what} that was "
        f"{joined(parts)} than recorded explains all that the declared model leaves."
    ), (
        f"Compare {runs} with the other runs: the amplifier's gain and limits, and the time stamps of torque and "
        "rate. Play them again; one set with all their frequencies (a multisine) would separate an effect of the "
        "platform from a run that differs."
    )


def _items(runs: int) -> list[tuple[int, Literal["gain", "delay"]]]:
    return [(i, kind) for i in range(runs) for kind in ("gain", "delay")]


def _columns(fit: OutputErrorFit, use: Sequence[Array]) -> tuple[Array, tuple[Array, Array]]:
    """Residual, and the sensitivities to all parameters and to every run's own gain and delay; nuisances gone.

    A linear platform under a torque larger by g is one with J, C and K smaller by g. Torque later than the motion is
    motion earlier than the torque.
    """
    rows, own, rests = [], [], []
    for i, s in enumerate(fit.shots):
        scale = np.where(np.abs(fit.vector) > 0, np.abs(fit.vector), 1.0)
        still = np.zeros(len(fit.names), dtype=bool)
        columns, state, residual = sensitivities(s, fit.structure, fit.names, fit.vector, scale, still)
        terms = [k for k, n in enumerate(fit.names) if n[0] in TERMS]
        whole = fit.vector + np.array([s.added if n == ("inertia",) else 0.0 for n in fit.names])
        gain = -columns[:, terms] @ whole[terms]
        moving, delay = s.trace.measured - residual, np.zeros(len(residual))
        for begin, end in s.edges:  # at which it jumps
            if end - begin > 1:
                delay[begin:end] = -np.gradient(moving[begin:end], s.trace.step_s)
        mask = s.weight & use[i]
        ones = [np.ones(int(mask.sum()))] if s.trace.biased else []
        q = np.linalg.qr(np.column_stack([state[mask], *ones]))[0]
        both = np.column_stack([columns, gain, delay, residual])[mask]
        both = both - q @ (q.T @ both)
        rows.append(both[:, :-3])
        wide = np.zeros((len(both), 2 * len(fit.shots)))
        wide[:, 2 * i : 2 * i + 2] = both[:, -3:-1]
        own.append(wide)
        rests.append(both[:, -1])
    return np.concatenate(rests), (np.concatenate(rows), np.concatenate(own))


def _solved(columns: Array, residual: Array) -> Array:
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    return np.asarray(np.linalg.lstsq(columns / size, residual, rcond=1e-12)[0] / size)


def _predicted_changes(fits: FreeRunFitter, base: OutputErrorFit) -> list[Change]:
    """As few changes as are foretold to leave only noise; none where no few do."""
    residual, (columns, own) = _columns(base, fits.use)
    basis = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]
    residual, own = residual - basis @ (basis.T @ residual), own - basis @ (basis.T @ own)
    items, chosen = _items(len(base.shots)), list[int]()
    size = np.maximum(np.linalg.norm(own, axis=0), 1e-300)
    scaled = own / size
    # A campaign of fifty runs asks for thousands of these small fits: from the normal equations, made once.
    gram, right, total = scaled.T @ scaled, scaled.T @ residual, float(residual @ residual)

    def fitted(several: Sequence[int]) -> tuple[Array, float]:
        x = np.linalg.lstsq(gram[np.ix_(several, several)], right[several], rcond=1e-12)[0]
        return x / size[several], total - float(right[several] @ x)

    aim = base.count * fits.noise**2
    enough = aim + (1.0 - EXPLAINED_SHARE) * max(total - aim, 0.0)
    while len({items[k][0] for k in chosen}) < len(base.shots) - 1 or len(chosen) < 1:
        left = {k: fitted([*chosen, k])[1] for k in range(len(items)) if k not in chosen}
        best = min(left, key=lambda k: left[k])
        chosen.append(best)
        if left[best] < enough:
            sizes = fitted(chosen)[0]
            return [Change(*items[k], float(v)) for k, v in zip(chosen, sizes, strict=True)]
    return []


def _changed(trace: Trace, index: int, total: dict[tuple[int, Literal["gain", "delay"]], float]) -> Trace:
    assert trace.torque is not None
    gain, late = total.get((index, "gain"), 0.0), total.get((index, "delay"), 0.0)
    if not (gain or late):
        return trace
    signal = TorqueSignal(trace.torque.time_s + late, (1.0 + gain) * trace.torque.torque_nm, trace.torque.hold)
    return replace(trace, torque=signal, _series={})
