"""How far the genetic algorithm stays from the optimum, before any polish.

python -m benchmarks.genetic_gap

The linear model: the paper's second experiment (500 individuals, 600 generations) against the closed form.
One shape parameter, gains and J, C, K solved inside (variable projection): against the best of 50 local searches.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from threadpoolctl import threadpool_limits

from benchmarks.campaigns import SETS, SIGMA_RAD_S, TRUTH, clean_rates, run_of, times, traces_from, white
from identify.estimate.initial_guess import best_rho, first_guess
from identify.estimate.regression import Regression, normal, solve
from identify.genetic.algorithm import search
from identify.genetic.per_set import genetic
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.arrays import Array
from rig.config.identify import GeneticConfig, IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import TERMS, Platform

SECOND = GeneticConfig(population=500, generations=600, crossover_probability=0.8, mutation_probability=0.05)
SMALL = GeneticConfig(population=24, generations=40, mutation_probability=0.5)  # one gene, a simulation's worth each
LOCAL_SEARCHES = 50
MOST_LINEAR, MOST_SHAPE = 0.01, 0.1
# effect, true values, its shape parameter, and the range searched
SHAPES = {
    "actuator_lag": ({"time": 3e-3}, "time", (1e-4, 3e-2)),
    "backlash": ({"half_gap": 3.3e-3}, "half_gap", (1e-4, 3e-2)),
    "stribeck_friction": ({"coulomb": 1.2, "static": 2.4, "speed": 0.08}, "speed", (5e-3, 5.0)),
}


@dataclass(frozen=True)
class ShapeGap:
    """One effect: best of the local searches, of the genetic algorithm, and how they differ."""

    effect: str
    local: float
    genetic: float
    objective_percent: float  # objective of the genetic one over the best local one, minus one
    seconds: tuple[float, float]

    @property
    def percent(self) -> float:
        """Difference of the shape parameter."""
        return 100.0 * abs(self.genetic / self.local - 1.0)


def linear_gaps(seeds: int, settings: GeneticConfig = SECOND) -> dict[str, float]:
    """Largest gap in percent over ``seeds`` searches, by parameter, on all five sets."""
    traces = traces_from(clean_rates(), white(np.random.default_rng(1)))
    start = first_guess(traces, Structure())
    whole = IdentifyConfig(genetic=settings)
    worst = dict.fromkeys(TERMS, 0.0)
    for seed in range(seeds):
        found = genetic("all", traces, TERMS, start, TRUTH, whole, seed, 0.0, False)
        worst = {n: max(v, found.gap_percent[n]) for n, v in worst.items()}
    return worst


def traces_with(effect: str, duration_s: float) -> list[Trace]:
    """Sets of a platform with one effect."""
    rng = np.random.default_rng(2)
    t = times(duration_s)
    out = []
    for i, (a, f) in enumerate(SETS):
        torque = TorqueSignal(t, a * np.sin(2.0 * np.pi * f * t))
        motion = simulate(Platform(*TRUTH.values(), {effect: SHAPES[effect][0]}), t, torque, substeps=16)
        noisy = motion.sensed_rate_rad_s + SIGMA_RAD_S * rng.standard_normal(len(t))
        out.append(prepare(run_of(noisy, a, f), i, SIGMA_RAD_S))
    return out


def projected(effect: str, traces: Sequence[Trace]) -> Callable[[float], float]:
    """Sum of squares as a function of the shape parameter alone; all linear parameters are solved for."""
    structure = Structure(effects=(effect,))
    truth = (SHAPES[effect][0][SHAPES[effect][1]],)
    solution = best_rho(traces, structure, {effect: truth}, first_guess(traces, Structure()))
    regression = Regression(traces, structure)

    def objective(shape: float) -> float:
        equations = normal(regression.blocks(solution.denominator, {effect: (shape,)}))
        return equations.rss(solve(equations.a, equations.b))

    return objective


def shape_gap(effect: str, duration_s: float = 4.0, searches: int = LOCAL_SEARCHES, seed: int = 0) -> ShapeGap:
    """The genetic algorithm beside local searches from random brackets, both in the logarithm of the shape."""
    objective = projected(effect, traces_with(effect, duration_s))
    low, high = np.log(SHAPES[effect][2])
    rng = np.random.default_rng(seed)
    began = time.perf_counter()
    best, best_at = np.inf, 0.0
    for _ in range(searches):
        centre, width = rng.uniform(low, high), 0.15 * (high - low)
        bracket = (max(low, centre - width), min(high, centre + width))
        found = minimize_scalar(lambda u: objective(float(np.exp(u))), bounds=bracket, options={"xatol": 1e-5})
        if found.fun < best:
            best, best_at = float(found.fun), float(found.x)
    middle = time.perf_counter()

    def population(people: Array) -> Array:
        return np.array([objective(float(np.exp(u))) for u in people[:, 0]])

    outcome = search(population, np.array([low]), np.array([high]), SMALL, rng)
    seconds = (middle - began, time.perf_counter() - middle)
    worse = 100.0 * (outcome.objective / best - 1.0)
    return ShapeGap(effect, float(np.exp(best_at)), float(np.exp(outcome.best[0])), worse, seconds)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--searches", type=int, default=LOCAL_SEARCHES)
    given = parser.parse_args()
    with threadpool_limits(1):
        gaps = linear_gaps(given.seeds)
        print(f"linear model, {given.seeds} seeds, largest gap to the closed form: ", end="")
        print(", ".join(f"{n} {v:.2g} %" for n, v in gaps.items()), f"(at most {MOST_LINEAR} %)\n")
        print("| effect | best local | genetic | apart % | objective apart % | s local, genetic |")
        print("|---" * 6 + "|")
        for effect in SHAPES:
            g = shape_gap(effect, searches=given.searches)
            apart = f"{g.percent:.2g} | {g.objective_percent:+.2g}"
            print(f"| {effect} | {g.local:.6g} | {g.genetic:.6g} | {apart} | {g.seconds[0]:.0f}, {g.seconds[1]:.0f} |")
    print(f"\nat most {MOST_SHAPE} % apart is asked for")


if __name__ == "__main__":
    main()
