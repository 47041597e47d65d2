"""Output error: the model simulated, compared with what the sensor really measured.

Each run is simulated in shots. One shot over a whole run is the maximum-likelihood fit for white sensor
noise; shorter shots, each with a start state of its own, keep a model that is still wrong close to the
data (multiple shooting). Sensitivities are differences of simulations; start states, gyro bias and
global parameters are solved together, start states eliminated first (Gauss-Newton with Levenberg's damping).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numba as nb
import numpy as np

from identify.regression import Structure
from identify.traces import Trace
from rig import effects
from rig.dynamics import Equations, Grid
from rig.dynamics.simulate import MAX_SUBSTEPS
from rig.platform import TERMS, Platform
from rig.recording.run import Array

Name = tuple[str, ...]
FIELD = {"inertia": "inertia_kg_m2", "damping": "damping_nm_s_rad", "stiffness": "stiffness_nm_rad"}
LEAD_S = 0.1  # of torque before a piece begins, for drives with memory
COARSEST = 16  # fine steps a sample while models are compared
ROBUST_FROM = 12  # shots: fewer show no outlier
OUTLIER = 4.0  # times the median error of a shot
SETTLE = 6  # rounds in which start states are fitted at fixed parameters
RUNAWAY = np.errstate(over="ignore", invalid="ignore", divide="ignore")  # a simulation may; its error is then infinite
STEP = 1e-6  # relative step of the differences: simulations repeat to 1e-13


def names_of(structure: Structure, runs: int) -> tuple[Name, ...]:
    """All parameters of a structure: terms, then every parameter of every effect (per run where it is one)."""
    out: list[Name] = [(t,) for t in TERMS if t in structure.terms]
    for name in structure.effects:
        for p in effects.get(name).parameters:
            out += [(name, p.name, str(r)) for r in range(runs)] if p.per_run else [(name, p.name)]
    return tuple(out)


def bounds_of(name: Name) -> tuple[float, float]:
    """Bounds of a parameter: inertia is positive, damping and stiffness are free, effects say their own."""
    if len(name) == 1:
        return (1e-12, np.inf) if name[0] == "inertia" else (-np.inf, np.inf)
    parameter = next(p for p in effects.get(name[0]).parameters if p.name == name[1])
    return parameter.low, parameter.high


def platform_of(
    structure: Structure, names: Sequence[Name], values: Array, run: int = 0, added: float = 0.0
) -> Platform:
    """The platform that a parameter vector stands for in one run."""
    terms = {"inertia": 0.0, "damping": 0.0, "stiffness": 0.0}
    held: dict[str, dict[str, float]] = {name: {} for name in structure.effects}
    for name, value in zip(names, values, strict=True):
        if len(name) == 1:
            terms[name[0]] = float(value)
        elif len(name) == 2 or int(name[2]) == run:
            held[name[0]][name[1]] = float(value)
    return Platform(terms["inertia"] + added, terms["damping"], terms["stiffness"], held, structure.terms)


@lru_cache(maxsize=128)
def _equations(structure: Structure, names: tuple[Name, ...], packed: bytes, run: int, added: float) -> Equations:
    return Equations(platform_of(structure, names, np.frombuffer(packed), run, added))


def equations_of(
    structure: Structure, names: Sequence[Name], values: Array, run: int = 0, added: float = 0.0
) -> Equations:
    """The equations that a parameter vector stands for in one run; runs that share them share the object."""
    per_run = any(len(name) == 3 for name in names)
    return _equations(structure, tuple(names), values.tobytes(), run if per_run else 0, added)


@dataclass
class Shots:
    """One run as the simulator sees it: its fine grid, its shots and their start states."""

    trace: Trace
    grid: Grid
    first: Any  # sample number at which each shot begins, (s,)
    starts: Array  # angle and rate there, (s, 2)
    bias: float = 0.0
    weight: Any = field(default=None)  # (n,) boolean: samples that count

    @property
    def number(self) -> int:
        """Which run of the recording it is."""
        return self.trace.number

    @property
    def added(self) -> float:
        """Known inertia mounted for this run."""
        return self.trace.run.added_inertia_kg_m2

    @cached_property
    def active(self) -> Any:
        """Which shots hold samples that count; the others are not simulated."""
        return np.array([bool(np.any(self.weight[a:b])) for a, b in self.edges])

    @cached_property
    def counts(self) -> Array:
        """Samples that count in each shot, (shots,)."""
        return np.array([float(np.sum(self.weight[a:b])) for a, b in self.edges])

    @cached_property
    def edges(self) -> list[tuple[int, int]]:
        """First sample and one past the last of each shot."""
        ends = [*self.first[1:].tolist(), len(self.trace.measured)]
        return list(zip(self.first.tolist(), ends, strict=True))


def make_shots(trace: Trace, substeps: int, length: int | None, use: Any = None) -> Shots:
    """Cut a run into shots of ``length`` samples (None: one), started from the smoothed measurement."""
    n = len(trace.measured)
    time = trace.start_s + trace.step_s * np.arange(n)
    begins = [0]  # every usable stretch begins anew: what happened in between is not to be predicted
    for a, b in trace.stretches:
        inside = np.arange(a, b + 1, length) if length else np.array([a])
        if length and len(inside) > 1 and b + 1 - inside[-1] < length // 2:
            inside = inside[:-1]
        begins += inside.tolist()
    first = np.unique(np.array(begins))
    angle, rate, _, _, _ = trace.fine
    ratio = (len(angle) - 1) // (n - 1)
    starts = np.stack([angle[first * ratio], rate[first * ratio]], axis=1)
    weight = trace.keep if use is None else trace.keep & use
    return Shots(trace, Grid(time, trace.torque, substeps, min(LEAD_S, trace.offset_s)), first, starts, 0.0, weight)


def predict(shots: Shots, equations: Equations, starts: Array, bias: float) -> Array:
    """The measured channel as the model gives it, shape (n,)."""
    grid = shots.grid
    torque = grid.shaft_torque(equations)
    ratio = round(shots.trace.step_s / grid.step_s)
    n = len(shots.trace.measured)
    rate = shots.trace.channel == "rate"
    active = [(a * ratio, min(b, n - 1) * ratio) for (a, b), on in zip(shots.edges, shots.active, strict=True) if on]
    fine = equations.integrate_shots(torque, grid.step_s, active, starts[shots.active], shots.trace.offset_s)
    if rate and equations.sensor.names:
        return np.asarray(equations.sensor.apply(fine[:, 1], grid.step_s)[: n * ratio : ratio] + bias)
    out = fine[: n * ratio : ratio, 1 if rate else 0]
    return out + bias if rate else out


@dataclass(frozen=True)
class Estimate:
    """A fitted output-error model.

    Attributes
    ----------
    sigma
        Root mean square of measured minus simulated over the samples that count.
    information
        Normal matrix of the global parameters, start states and bias eliminated, for unit noise.
    """

    structure: Structure
    names: tuple[Name, ...]
    values: Array
    sigma: float
    count: int
    information: Array
    shots: tuple[Shots, ...]
    converged: bool

    def platform(self, run: int = 0, added: float = 0.0) -> Platform:
        """The fitted platform, as it stood in one run."""
        return platform_of(self.structure, self.names, self.values, run, added)

    def simulated(self) -> list[Array]:
        """The measured channel as the model gives it, one array a run."""
        return [predict(s, Equations(self.platform(s.number, s.added)), s.starts, s.bias) for s in self.shots]

    def residuals(self) -> list[Array]:
        """Measured minus simulated, one array a run."""
        return [s.trace.measured - y for s, y in zip(self.shots, self.simulated(), strict=True)]


@dataclass
class _Normal:
    """One run's share of the normal equations; start states and bias eliminated, with the way back."""

    a: Array
    b: Array
    losses: Array
    counts: Array
    back: Callable[[Array], tuple[Array, float]]


def _linearise(
    s: Shots, structure: Structure, names: Sequence[Name], x: Array, scale: Array, fixed: Any, outlier: float
) -> _Normal:
    columns, state, residual = _sensitivities(s, structure, names, x, scale, fixed)
    return _eliminate(s, columns, state, residual, s.trace.biased, outlier)


@RUNAWAY
def jacobian(s: Shots, estimate: Estimate) -> tuple[Array, Array]:
    """Sensitivities and residual of the samples that count, start states and bias projected out: (m, p), (m,)."""
    scale = np.where(np.abs(estimate.values) > 0, np.abs(estimate.values), 1.0)
    still = np.zeros(len(estimate.names), dtype=bool)
    columns, state, residual = _sensitivities(s, estimate.structure, estimate.names, estimate.values, scale, still)
    parts = []
    for begin, end in s.edges:
        mask = s.weight[begin:end]
        if not np.any(mask):
            continue
        ones = [np.ones(int(mask.sum()))] if s.trace.biased else []
        both = np.column_stack([columns[begin:end][mask], *ones, residual[begin:end][mask]])
        q = np.linalg.qr(state[begin:end][mask])[0]
        parts.append(both - q @ (q.T @ both))
    both = np.concatenate(parts)
    if s.trace.biased:
        one = both[:, -2] / np.linalg.norm(both[:, -2])
        both = np.delete(both - np.outer(one, one @ both), -2, axis=1)
    return both[:, :-1], both[:, -1]


@RUNAWAY
def _sensitivities(
    s: Shots, structure: Structure, names: Sequence[Name], x: Array, scale: Array, fixed: Any
) -> tuple[Array, Array, Array]:
    """Derivatives by the parameters (n, p) and by the shots' start states (n, 2), and the residual (n,)."""

    def run(values: Array, starts: Array) -> Array:
        return predict(s, equations_of(structure, names, values, s.number, s.added), starts, s.bias)

    base = run(x, s.starts)
    residual = s.trace.measured - base
    columns = np.zeros((len(base), len(x)))
    for i in range(len(x)):
        if fixed[i] or (len(names[i]) == 3 and int(names[i][2]) != s.number):
            continue
        h = STEP * scale[i]
        _low, high = bounds_of(names[i])
        h = -h if x[i] + h > high else h
        moved = x.copy()
        moved[i] += h
        columns[:, i] = (run(moved, s.starts) - base) / h
    span = np.maximum(np.max(np.abs(s.trace.fine[0])), 1e-9), np.maximum(np.max(np.abs(s.trace.fine[1])), 1e-9)
    state = np.zeros((len(base), 2))
    for k in range(2):
        moved = s.starts.copy()
        moved[:, k] += STEP * 10.0 * span[k]
        state[:, k] = (run(x, moved) - base) / (STEP * 10.0 * span[k])
    return columns, state, residual


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _schur(wide, state, residual, used, edges, trust):  # type: ignore[no-untyped-def]
    """Normal equations with every shot's two start states eliminated, and what leads back to them."""
    q, shots = wide.shape[1], len(edges)
    a, b = np.zeros((q, q)), np.zeros(q)
    inverse, zw, zr = np.zeros((shots, 2, 2)), np.zeros((shots, 2, q)), np.zeros((shots, 2))
    ww, wr = np.zeros((q, q)), np.zeros(q)
    for s in range(shots):
        ww[:], wr[:] = 0.0, 0.0
        z00, z01, z11 = 0.0, 0.0, 0.0
        for i in range(edges[s, 0], edges[s, 1]):
            if not used[i]:
                continue
            r, u, v = residual[i], state[i, 0], state[i, 1]
            z00 += u * u
            z01 += u * v
            z11 += v * v
            zr[s, 0] += u * r
            zr[s, 1] += v * r
            for j in range(q):
                x = wide[i, j]
                zw[s, 0, j] += u * x
                zw[s, 1, j] += v * x
                wr[j] += x * r
                for k in range(j + 1):
                    ww[j, k] += x * wide[i, k]
        det = z00 * z11 - z01 * z01
        if det > 1e-12 * z00 * z11:
            inverse[s, 0, 0], inverse[s, 1, 1] = z11 / det, z00 / det
            inverse[s, 0, 1] = inverse[s, 1, 0] = -z01 / det
        else:  # only one of them shows
            inverse[s, 0, 0] = 1.0 / z00 if z00 >= z11 and z00 > 0.0 else 0.0
            inverse[s, 1, 1] = 1.0 / z11 if z11 > z00 else 0.0
        for j in range(q):
            ij0 = inverse[s, 0, 0] * zw[s, 0, j] + inverse[s, 0, 1] * zw[s, 1, j]
            ij1 = inverse[s, 1, 0] * zw[s, 0, j] + inverse[s, 1, 1] * zw[s, 1, j]
            b[j] += trust[s] * (wr[j] - ij0 * zr[s, 0] - ij1 * zr[s, 1])
            for k in range(j + 1):
                a[j, k] += trust[s] * (ww[j, k] - ij0 * zw[s, 0, k] - ij1 * zw[s, 1, k])
    for j in range(q):
        for k in range(j):
            a[k, j] = a[j, k]
    return a, b, inverse, zw, zr


def _eliminate(s: Shots, columns: Array, state: Array, residual: Array, rate: bool, outlier: float) -> _Normal:
    """Normal equations of one run; shots whose error is far beyond ``outlier`` (root mean square) count less."""
    p = columns.shape[1]
    used, counts = s.weight, s.counts
    losses = _losses(s, residual)
    if not (np.all(np.isfinite(columns[used])) and np.all(np.isfinite(state[used])) and np.all(np.isfinite(losses))):
        # The simulation ran away: nothing can be said from here.
        return _Normal(
            np.zeros((p, p)), np.zeros(p), np.full(len(counts), np.inf), counts, lambda dx: (0.0 * s.starts, 0.0)
        )
    wide = np.column_stack([columns, np.ones(len(residual))]) if rate else np.ascontiguousarray(columns)
    trust = 1.0 / (1.0 + losses / np.maximum(counts, 1.0) / outlier**2)
    a, b, inverse, zw, zr = _schur(wide, state, residual, used, np.array(s.edges), trust)
    right, column, pivot = 0.0, np.zeros(p), 1.0
    if rate:
        pivot = max(a[p, p], 1e-300)
        column, right = a[:p, p].copy(), b[p]
        a, b = a[:p, :p] - np.outer(column, column) / pivot, b[:p] - column * right / pivot

    def back(dx: Array) -> tuple[Array, float]:
        bias = float((right - column @ dx) / pivot) if rate else 0.0
        full = np.append(dx, bias) if rate else dx
        return np.einsum("sij,sj->si", inverse, zr - zw @ full), bias

    return _Normal(a, b, losses, counts, back)


def _total(parts: Sequence[_Normal]) -> tuple[Array, Array, Array, Array]:
    return (
        np.sum([q.a for q in parts], axis=0), np.sum([q.b for q in parts], axis=0),
        np.concatenate([q.losses for q in parts]), np.concatenate([q.counts for q in parts]),
    )  # fmt: skip


def _outlier(losses: Array, counts: Array) -> float:
    """Root mean square beyond which a shot is mistrusted; none is where there are only a few."""
    used = counts > 0
    if np.sum(used) < ROBUST_FROM or not np.all(np.isfinite(losses[used])):
        return np.inf
    return float(OUTLIER * np.sqrt(max(np.median(losses[used] / counts[used]), 1e-300)))


def _cost(losses: Array, counts: Array, outlier: float) -> float:
    """Sum of squares, with the shots that are mistrusted growing only as a logarithm."""
    if not np.isfinite(outlier):
        return float(np.sum(losses))
    n = np.maximum(counts, 1.0)
    return float(np.sum(n * outlier**2 * np.log1p(losses / n / outlier**2)))


def refine(
    traces: Sequence[Trace],
    structure: Structure,
    start: Mapping[Name, float],
    shot_s: float | None = None,
    iterations: int = 12,
    use: Sequence[Any] | None = None,
    carry: Sequence[Shots] | None = None,
    fixed: Sequence[Name] = (),
    tolerance: float = 1e-4,
    coarse: bool = False,
    hopeless: float = np.inf,
) -> Estimate:
    """Fit all parameters of a structure by output error.

    Parameters
    ----------
    start
        A value for every parameter in ``names_of(structure)``.
    shot_s
        Length of a shot in seconds; None simulates each run in one go.
    use
        One boolean array a run: samples that count (None: all usable ones).
    carry
        Shots of an earlier estimate whose start states to begin from, where their layout agrees.
    fixed
        Parameters that stay at their start value.
    tolerance
        Stop when the sum of squares falls by less than this share of itself times 1e-2, or when no
        parameter moves by more than this many of its standard errors.
    coarse
        Half the fine steps: a hundredth of the noise, enough while models are compared.
    hopeless
        Give up after three iterations where the root mean square is still above this.
    """
    names = names_of(structure, 1 + max(t.number for t in traces))
    x = np.array([start[name] for name in names])
    still = np.array([name in fixed for name in names])
    shots = _shots_for(traces, structure, names, x, shot_s, use, carry, coarse)
    workers = ThreadPoolExecutor(2)
    try:
        return _levenberg(workers, shots, structure, names, x, still, iterations, tolerance, hopeless)
    finally:
        workers.shutdown()


def _shots_for(
    traces: Sequence[Trace], structure: Structure, names: Sequence[Name], x: Array,
    shot_s: float | None, use: Sequence[Any] | None, carry: Sequence[Shots] | None, coarse: bool,
) -> list[Shots]:  # fmt: skip
    out = []
    for i, trace in enumerate(traces):
        equations = Equations(platform_of(structure, names, x, trace.number, trace.run.added_inertia_kg_m2))
        substeps = min(MAX_SUBSTEPS, equations.substeps(trace.step_s))
        substeps = int(np.clip(substeps // 2, 2, COARSEST)) if coarse else substeps
        if trace.torque is not None and trace.torque.hold == "zero_order":
            # A step that spans several held values sees only their mean: that alone is a sigma or two.
            held = trace.step_s / float(np.median(np.diff(trace.torque.time_s)))
            substeps = min(MAX_SUBSTEPS, max(substeps, round(held)))
        length = None if shot_s is None else max(8, round(shot_s / trace.step_s))
        shots = make_shots(trace, substeps, length, None if use is None else use[i])
        if carry is not None and len(carry[i].first) == len(shots.first):
            shots.starts, shots.bias = carry[i].starts.copy(), carry[i].bias
        out.append(shots)
    return out


def _levenberg(
    workers: ThreadPoolExecutor, shots: list[Shots], structure: Structure, names: tuple[Name, ...],
    x: Array, still: Any, iterations: int, tolerance: float, hopeless: float,
) -> Estimate:  # fmt: skip
    scale = np.where(np.abs(x) > 0, np.abs(x), 1.0)
    low = np.array([bounds_of(n)[0] for n in names])
    high = np.array([bounds_of(n)[1] for n in names])
    damping, converged = 1e-6, False

    def linearise(x: Array, shots: Sequence[Shots], outlier: float) -> list[_Normal]:
        return list(workers.map(lambda s: _linearise(s, structure, names, x, scale, still, outlier), shots))

    first = list(workers.map(lambda s: _losses_at(s, structure, names, x), shots))
    counts = np.concatenate([s.counts for s in shots])
    losses = np.concatenate(first)
    outlier = _outlier(losses, counts)
    parts = linearise(x, shots, outlier)
    a, b, losses, counts = _total(parts)
    count = int(np.sum(counts))
    for k in range(iterations if np.all(np.isfinite(losses)) else 0):
        cost = _cost(losses, counts, outlier)
        if k == 3 and cost > hopeless**2 * count:
            break
        step = None
        trial, trial_cost = shots, cost
        for _try in range(8):
            size = np.sqrt(np.maximum(np.diag(a), 1e-300))
            free = ~still
            scaled = (a / np.outer(size, size))[np.ix_(free, free)]
            dx = np.zeros(len(x))
            dx[free] = np.linalg.lstsq(
                scaled + damping * np.eye(int(free.sum())), (b / size)[free], rcond=1e-14
            )[0] / size[free]  # fmt: skip
            new = ordered(names, np.clip(x + dx, low, high))
            moved = [q.back(new - x) for q in parts]
            trial = [_moved(s, m) for s, m in zip(shots, moved, strict=True)]
            found = list(workers.map(lambda s, new=new: _losses_at(s, structure, names, new), trial))
            trial_cost = _cost(np.concatenate(found), counts, outlier)
            if trial_cost <= cost * (1.0 + 1e-12):
                step = new
                break
            damping = max(damping * 30.0, 1e-5)
        if step is None:
            converged = True
            break
        sigma = np.sqrt(cost / max(count, 1))
        small = bool(np.all(np.abs(step - x) * np.sqrt(np.maximum(np.diag(a), 0.0)) <= tolerance * 30.0 * sigma))
        flat = cost - trial_cost < 1e-2 * tolerance * cost
        x, shots, damping = step, trial, max(damping / 30.0, 1e-9)
        outlier = _outlier(np.concatenate(found), counts)
        parts = linearise(x, shots, outlier)
        a, b, losses, counts = _total(parts)
        if small or flat:
            converged = True
            break
    sigma = float(np.sqrt(_cost(losses, counts, outlier) / max(count, 1)))
    return Estimate(structure, names, x, sigma, count, a, tuple(shots), converged)


def ordered(names: Sequence[Name], values: Array) -> Array:
    """Values with every pair that an effect declares as ordered put in order (static is at least coulomb)."""
    index = {name: i for i, name in enumerate(names)}
    out = values.copy()
    for effect in {n[0] for n in names if len(n) == 2}:
        for smaller, larger in effects.get(effect).ordered:
            i, k = index[(effect, smaller)], index[(effect, larger)]
            if out[i] > out[k]:
                out[i] = out[k] = 0.5 * (out[i] + out[k])
    return out


def _moved(s: Shots, by: tuple[Array, float]) -> Shots:
    return Shots(s.trace, s.grid, s.first, s.starts + by[0], s.bias + by[1], s.weight)


def _losses_at(s: Shots, structure: Structure, names: Sequence[Name], x: Array) -> Array:
    equations = equations_of(structure, names, x, s.number, s.added)
    return _losses(s, s.trace.measured - predict(s, equations, s.starts, s.bias))


def evaluate(
    estimate: Estimate,
    traces: Sequence[Trace],
    use: Sequence[Any] | None = None,
    shot_s: float | None = None,
    coarse: bool = False,
) -> Estimate:
    """The same parameters on other samples: only start states and biases are fitted there."""
    names, x, structure = estimate.names, estimate.values, estimate.structure
    shots = _shots_for(traces, structure, names, x, shot_s, use, None, coarse)
    with ThreadPoolExecutor(2) as workers:
        settled = list(workers.map(lambda s: _settle(s, structure, names, x), shots))
    rss = sum(float(np.sum(losses)) for _, losses in settled)
    count = sum(int(np.sum(s.weight)) for s, _ in settled)
    sigma = float(np.sqrt(rss / max(count, 1)))
    return Estimate(structure, names, x, sigma, count, np.zeros((len(x),) * 2), tuple(s for s, _ in settled), True)


@RUNAWAY
def _losses(s: Shots, residual: Array) -> Array:
    """Sum of squares of every shot over the samples that count, (shots,); infinite where it ran away."""
    squares = np.where(s.weight, residual**2, 0.0)
    sums = np.array([float(np.sum(squares[a:b])) for a, b in s.edges])
    return np.where(np.isfinite(sums), sums, np.inf)


@RUNAWAY
def _settle(s: Shots, structure: Structure, names: Sequence[Name], x: Array) -> tuple[Shots, Array]:
    """Start states and bias of one run at fixed parameters; every shot keeps what is best for itself."""
    still = np.ones(len(x), dtype=bool)
    equations = equations_of(structure, names, x, s.number, s.added)
    losses = _losses(s, s.trace.measured - predict(s, equations, s.starts, s.bias))
    share = np.ones(len(s.first))  # of the full step that each shot dares
    for _ in range(SETTLE):
        part = _linearise(s, structure, names, x, np.ones(len(x)), still, np.inf)
        step, bias = part.back(np.zeros(len(x)))
        trial = _moved(s, (step * share[:, None], bias))
        new = _losses(trial, trial.trace.measured - predict(trial, equations, trial.starts, trial.bias))
        worse = ~(new <= losses)
        stuck = bool(np.all(worse)) or np.sum(np.where(worse, losses, new)) > np.sum(losses) * (1.0 - 1e-4)
        if stuck and (np.min(share) < 0.2 or not np.any(worse)):
            break
        share = np.where(worse, 0.3 * share, np.minimum(1.0, 2.0 * share))
        trial.starts[worse] = s.starts[worse]
        kept = _losses(trial, trial.trace.measured - predict(trial, equations, trial.starts, trial.bias))
        if np.sum(kept) > np.sum(losses):
            trial.bias = s.bias
            kept = _losses(trial, trial.trace.measured - predict(trial, equations, trial.starts, trial.bias))
        s, losses = trial, kept
    return s, losses
