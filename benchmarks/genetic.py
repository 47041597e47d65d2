"""The paper's search (500 individuals, 600 generations, five sets) by this project and by five optimisers.

pip install -e '.[peers]'
python -m benchmarks.genetic --out benchmarks/kept

All minimise one sum of squares, e(k) = M - J acc - C rate - K angle over 50 000 samples. The peers twice: with e(k)
written out, as their users would, and with the condensed objective that this project makes of it (A'A, A'b, b'b).
Errors are distances from the closed form of that same sum, in percent: what the optimiser adds. cma stops by itself.
"""

from __future__ import annotations

import contextlib
import io
import time
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy import optimize, signal
from threadpoolctl import threadpool_limits

from benchmarks.campaigns import SAMPLE_S, SETS, TRUTH, clean_rates, times, white
from benchmarks.kept import Result, parser_of, print_and_write
from identify.genetic.algorithm import QuadraticObjective, search
from rig.arrays import Array
from rig.config.identify import GeneticConfig

LOW, HIGH = np.zeros(3), 10.0 * np.array(list(TRUTH.values()))
CUTOFF_HZ = 60.0  # of the low-pass before the differences, applied to both sides
SEED = 1
One = Callable[[Array], float]  # J, C, K to the sum of squares
Peer = Callable[[One, int, int], Array]  # objective, individuals, generations to the best J, C, K


def equations() -> tuple[Array, Array]:
    """Rows (acceleration, rate, angle), shape (n, 3), and torque (n,) of all sets, low-passed alike."""
    sos = signal.butter(3, 2.0 * CUTOFF_HZ * SAMPLE_S, output="sos")
    rows, torques = [], []
    for (peak, f), rate, noise in zip(SETS, clean_rates(), white(np.random.default_rng(SEED)), strict=True):
        w = signal.sosfiltfilt(sos, rate + noise)
        m = signal.sosfiltfilt(sos, peak * np.sin(2.0 * np.pi * f * times()))
        angle = np.cumsum(w) * SAMPLE_S - 0.5 * SAMPLE_S * (w + w[0])
        inner = slice(100, -100)
        rows.append(np.stack([np.gradient(w, SAMPLE_S), w, angle], axis=1)[inner])
        torques.append(m[inner])
    return np.concatenate(rows), np.concatenate(torques)


def by_pymoo(goal: One, individuals: int, generations: int) -> Array:
    """pymoo's GA on an elementwise problem."""
    from pymoo.algorithms.soo.nonconvex.ga import GA  # noqa: PLC0415
    from pymoo.core.problem import ElementwiseProblem  # noqa: PLC0415
    from pymoo.optimize import minimize  # noqa: PLC0415

    class Problem(ElementwiseProblem):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n_var=3, n_obj=1, xl=LOW, xu=HIGH)

        def _evaluate(self, x: Array, out: dict[str, Any], *_: Any, **__: Any) -> None:
            out["F"] = goal(x)

    return np.asarray(minimize(Problem(), GA(pop_size=individuals), ("n_gen", generations), seed=SEED).X)


def by_deap(goal: One, individuals: int, generations: int) -> Array:
    """DEAP's eaSimple with blend crossover and Gaussian mutation, as in its examples."""
    import random  # noqa: PLC0415

    from deap import algorithms, base, creator, tools  # noqa: PLC0415

    random.seed(SEED)
    if not hasattr(creator, "Least"):
        creator.create("Least", base.Fitness, weights=(-1.0,))
        creator.create("Individual", list, fitness=creator.Least)
    box = base.Toolbox()
    box.register("gene", lambda: [random.uniform(a, b) for a, b in zip(LOW, HIGH, strict=True)])
    box.register("individual", tools.initIterate, creator.Individual, box.gene)
    box.register("population", tools.initRepeat, list, box.individual)
    box.register("evaluate", lambda x: (goal(np.asarray(x)),))
    box.register("mate", tools.cxBlend, alpha=0.5)
    box.register("mutate", tools.mutGaussian, mu=[0.0] * 3, sigma=(0.01 * HIGH).tolist(), indpb=0.3)
    box.register("select", tools.selTournament, tournsize=3)
    best = tools.HallOfFame(1)
    algorithms.eaSimple(box.population(n=individuals), box, 0.8, 0.05, generations, halloffame=best, verbose=False)
    return np.asarray(best[0], dtype=float)


def by_pygad(goal: One, individuals: int, generations: int) -> Array:
    """PyGAD with its defaults but for the sizes and the ranges."""
    import pygad  # noqa: PLC0415

    ga = pygad.GA(
        num_generations=generations, num_parents_mating=individuals // 2, sol_per_pop=individuals, num_genes=3,
        fitness_func=lambda _ga, x, _index: 1.0 / goal(x), random_seed=SEED, suppress_warnings=True,
        gene_space=[{"low": a, "high": b} for a, b in zip(LOW, HIGH, strict=True)], mutation_num_genes=1,
    )  # fmt: skip
    ga.run()
    return np.asarray(ga.best_solution()[0], dtype=float)


def by_scipy(goal: One, individuals: int, generations: int) -> Array:
    """scipy's differential evolution, not polished; it may stop where the population has come together."""
    found = optimize.differential_evolution(
        goal, list(zip(LOW, HIGH, strict=True)), popsize=-(-individuals // 3), maxiter=generations, polish=False,
        seed=SEED,
    )  # fmt: skip
    return np.asarray(found.x)


def by_cma(goal: One, individuals: int, generations: int) -> Array:
    """cma, genes scaled to the range."""
    import cma  # noqa: PLC0415

    options = {"popsize": individuals, "maxiter": generations, "bounds": [0, 1], "seed": SEED, "verbose": -9}
    found = cma.fmin2(lambda u: goal(np.asarray(u) * HIGH), 3 * [0.5], 0.3, options)
    return np.asarray(found[0]) * HIGH


PEERS: dict[str, tuple[Peer, str]] = {
    "pymoo GA": (by_pymoo, "pymoo"),
    "DEAP": (by_deap, "deap"),
    "PyGAD": (by_pygad, "pygad"),
    "scipy DE": (by_scipy, "scipy"),
    "cma": (by_cma, "cma"),
}
GENETIC = ("pymoo GA", "DEAP", "PyGAD")  # those that are genetic algorithms


def measured(individuals: int, generations: int, repeats: int) -> Result:
    """The whole table; of ``repeats`` runs the fastest."""
    rows, torque = equations()
    exact = np.linalg.lstsq(rows, torque, rcond=None)[0]

    def written_out(x: Array) -> float:
        return float(np.sum((torque - rows @ x) ** 2))

    def ours() -> Array:
        settings = GeneticConfig(
            population=individuals, generations=generations, crossover_probability=0.8, mutation_probability=0.05,
            restarts=0,
        )  # fmt: skip
        goal = QuadraticObjective(rows.T @ rows, rows.T @ torque, float(torque @ torque))
        return search(goal, LOW, HIGH, settings, np.random.default_rng(SEED)).best

    condensed = QuadraticObjective(rows.T @ rows, rows.T @ torque, float(torque @ torque))

    def one(x: Array) -> float:
        return float(condensed(x[None, :])[0])

    table = [_row("isp-rig", "condensed, condensing included", ours, exact, repeats)]
    for name, (peer, package) in PEERS.items():
        if find_spec(package) is None:
            table.append({"optimiser": name, "objective": "not installed"})
            continue
        for kind, goal in (("written out", written_out), ("condensed", one)):
            once = 1 if kind == "written out" else repeats
            table.append(_row(name, kind, lambda p=peer, g=goal: p(g, individuals, generations), exact, once))
    return Result(
        "genetic", {"individuals": individuals, "generations": generations}, [SEED], _ratios(table), table
    )  # fmt: skip


def _row(name: str, objective: str, run: Callable[[], Array], exact: Array, repeats: int) -> dict[str, Any]:
    took, found = np.inf, exact
    for _ in range(repeats):
        began = time.perf_counter()
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = run()
        took = min(took, time.perf_counter() - began)
    off = 100.0 * np.abs(found / exact - 1.0)
    return {
        "optimiser": name, "objective": objective, "s": took, "J %": float(off[0]), "C %": float(off[1]),
        "K %": float(off[2]),
    }  # fmt: skip


def _ratios(table: list[dict[str, Any]]) -> dict[str, float]:
    """How many times faster than the fastest genetic peer, either way."""
    ours = table[0]["s"]
    out = {}
    for kind in ("written out", "condensed"):
        peers = [row["s"] for row in table if row["optimiser"] in GENETIC and row["objective"] == kind]
        if peers:
            out[f"times faster than the fastest genetic peer, {kind}"] = min(peers) / ours
    return out


def result_of(small: bool) -> Result:
    """The table at its size."""
    with threadpool_limits(1):
        return measured(100, 60, 3) if small else measured(500, 600, 3)


def main() -> None:
    """Print the table."""
    given = parser_of(__doc__).parse_args()
    print_and_write(result_of(given.small), given.out, given.small)


if __name__ == "__main__":
    main()
