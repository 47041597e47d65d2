"""The paper's genetic algorithm (section 2.1, Eq. 12-14, Fig. 5): real-coded, seeded, one array a generation.

What the paper fixes: fitness f_i = (1/J_i) / sum(1/J_i) with roulette selection (Eq. 13), the sizes and
probabilities, and J < J_dec with repeats (Eq. 14). What it leaves open is chosen here:

* Genes are the parameters themselves, linear between ``low`` and ``high`` (never their logarithm): the
  objective is a quadratic form in them, so that its valley stays straight, and a range may span zero.
* Crossover takes a point on the line through both parents, up to their distance beyond either. All
  genes share that point: along the narrow valley of J and K children stay in the valley.
* Mutation adds a normal step to each gene with the given probability, a tenth of the range at first.
* ``shrinking_mutation``: that step falls geometrically to 1e-6 of the range at the last generation.
* ``elitism``: of parents and children together the best survive. Without it children replace parents and
  the selection is Eq. 13 alone, whose pressure vanishes where all J are nearly equal, near the noise floor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rig.config.identify import GeneticConfig
from rig.recording.run import Array

Objective = Callable[[Array], Array]

FIRST_STEP = 0.1  # standard deviation of a mutation, as a share of the range
LAST_STEP = 1e-6  # the same in the last generation, where mutations shrink
OVERSHOOT = 1.0  # of the parents' distance, beyond either: outweighs the pull of 1/J, which spans decades at first
BOUND_MARGIN = 1e-3  # of the range: closer than this the best individual leans on its bound


@dataclass(frozen=True)
class Outcome:
    """The best of the last generation, over all repeats.

    ``history`` is the best objective of every generation of the last repeat, shape (generations,); without
    elitism it may rise again. ``at_edge`` marks parameters whose best value leans on its bound: widen the range.
    """

    best: Array  # (p,)
    objective: float
    history: Array
    restarts: int
    accepted: bool
    at_edge: tuple[bool, ...]


def search(
    objective: Objective,
    low: Array,
    high: Array,
    settings: GeneticConfig,
    rng: np.random.Generator,
    j_dec: float | None = None,
) -> Outcome:
    """Minimise ``objective`` between ``low`` and ``high``; repeat from new individuals until J < ``j_dec``.

    Parameters
    ----------
    objective
        From a population (m, p) to J of each individual (m,), not negative; what is not finite never wins.
    low, high
        Shape (p,), in the units of the parameters. Equal bounds hold a parameter fixed.
    settings
        Population, generations, probabilities, elitism, shrinking mutation, and the repeats allowed.
    j_dec
        Eq. 14. None accepts the first repeat.

    Raises
    ------
    ValueError
        Where the bounds are not finite, not ordered or of different length.
    """
    low, high = np.atleast_1d(np.asarray(low, dtype=float)), np.atleast_1d(np.asarray(high, dtype=float))
    if low.ndim != 1 or low.shape != high.shape or not np.all(np.isfinite(low) & np.isfinite(high) & (low <= high)):
        raise ValueError(f"search range from {low.tolist()} to {high.tolist()}: give finite bounds, low <= high")
    best: Array = 0.5 * (low + high)
    best_value = np.inf
    for repeat in range(settings.restarts + 1):
        found, value, history = _evolve(objective, low, high, settings, rng)
        if repeat == 0 or value < best_value:
            best, best_value = found, value
        accepted = j_dec is None or best_value < j_dec
        if accepted:
            break
    near = BOUND_MARGIN * (high - low)
    at_edge = (high > low) & ((best - low < near) | (high - best < near))
    return Outcome(best, best_value, history, repeat, accepted, tuple(bool(e) for e in at_edge))


def _evolve(
    objective: Objective, low: Array, high: Array, settings: GeneticConfig, rng: np.random.Generator
) -> tuple[Array, float, Array]:
    """The best of the last generation, its objective, and the best objective of each generation (generations,)."""
    size, span = settings.population, high - low
    people: Array = low + span * rng.random((size, len(low)))
    values = _valued(objective, people)
    history = np.empty(settings.generations)
    for generation in range(settings.generations):
        step = span * _mutation_step(generation, settings)
        children, changed = _offspring(people, values, settings, step, rng)
        np.minimum(np.maximum(children, low, out=children), high, out=children)
        child_values = _valued(objective, children)
        if settings.elitism:
            # A clone stands among the parents already; letting it in again would fill the population with it.
            everyone = np.concatenate([people, children[changed]])
            all_values = np.concatenate([values, child_values[changed]])
            keep = all_values.argpartition(size - 1)[:size]
            people, values = everyone[keep], all_values[keep]
        else:
            people, values = children, child_values
        history[generation] = values.min()
    at = int(np.argmin(values))
    return people[at].copy(), float(values[at]), history


def _valued(objective: Objective, people: Array) -> Array:
    values = np.asarray(objective(people), dtype=float)
    return np.where(np.isfinite(values), values, np.inf)


def _mutation_step(generation: int, settings: GeneticConfig) -> float:
    if not settings.shrinking_mutation:
        return FIRST_STEP
    share = generation / max(1, settings.generations - 1)
    return FIRST_STEP * float((LAST_STEP / FIRST_STEP) ** share)


def fitness(values: Array) -> Array:
    """Eq. 13: f_i = (1/J_i) / sum(1/J_i), shape (m,), also where some J are zero or none is finite."""
    floor = float(values.min())
    if not np.isfinite(floor):
        return np.full(len(values), 1.0 / len(values))
    inverse = (values == 0.0).astype(float) if floor == 0.0 else floor / values
    return np.asarray(inverse / inverse.sum())


def _roulette(values: Array, count: int, rng: np.random.Generator) -> Array:
    wheel = fitness(values).cumsum()
    return np.asarray(wheel.searchsorted(wheel[-1] * rng.random(count), side="right"))


def _offspring(
    people: Array, values: Array, settings: GeneticConfig, step: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """As many children as there are people, and which of them differ from their first parent, (m,)."""
    size, genes = people.shape
    first, second = people[_roulette(values, size, rng)], people[_roulette(values, size, rng)]
    crossed = rng.random((size, 1)) < settings.crossover_probability
    point = rng.uniform(-OVERSHOOT, 1.0 + OVERSHOOT, (size, 1))
    children = np.where(crossed, first + point * (second - first), first)
    mutated = rng.random((size, genes)) < settings.mutation_probability
    children += np.where(mutated, step * rng.standard_normal((size, genes)), 0.0)
    return children, (children != first).any(axis=1)


class QuadraticObjective:
    """Eq. 12 of a linear model, J(x) = c - 2 b.x + x.A.x: its cost does not grow with the number of samples.

    Evaluated as J_min + |R (x - x*)|^2 around the closed-form optimum x*, since the plain form loses
    every digit that matters near the noise floor.

    Parameters
    ----------
    a, b, c
        Shapes (p, p), (p,), (): H'H, H'y and y'y of the regression y = H x + e. The columns of H may
        differ by any factor; they are scaled to equal length first.
    """

    def __init__(self, a: Array, b: Array, c: float) -> None:
        a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
        length = np.sqrt(np.maximum(np.diag(a), 0.0))
        length = np.where(length > 0.0, length, 1.0)
        power, axes = np.linalg.eigh(a / np.outer(length, length))
        power = np.where(power > len(b) * np.finfo(float).eps * power[-1], power, 0.0)
        inverse = np.divide(1.0, power, out=np.zeros_like(power), where=power > 0.0)
        along = axes.T @ (b / length)
        self.closed_form: Array = axes @ (inverse * along) / length  # (p,); zero along what nothing determines
        self.minimum = max(0.0, float(c) - float(along**2 @ inverse))
        self._root: Array = np.sqrt(power)[:, None] * axes.T * length

    def __call__(self, people: Array) -> Array:
        """J of each row of ``people`` (m, p): shape (m,)."""
        away = (np.atleast_2d(people) - self.closed_form) @ self._root.T
        return np.asarray(self.minimum + np.einsum("ij,ij->i", away, away))

    def gap_percent(self, best: Array) -> Array:
        """How far ``best`` (p,) is from the closed form, in percent of it, (p,); infinite against a zero."""
        size = np.abs(self.closed_form)
        away = 100.0 * np.abs(np.asarray(best, dtype=float) - self.closed_form)
        return np.divide(away, size, out=np.where(away > 0.0, np.inf, 0.0), where=size > 0.0)
