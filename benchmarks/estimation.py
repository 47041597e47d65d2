"""J, C and K of the five sets at equal accuracy: this project, output error by other tools, a Kalman-filter likelihood.

pip install -e '.[peers]'
pip install jax-sysid            # only if it is to be in the table: it holds numpy and scipy back
python -m benchmarks.estimation --out benchmarks/kept

The output-error peers are those of `benchmarks.peers`, started from drawing-board values. The Kalman filter is that of
statsmodels, its likelihood written as its documentation does and maximised by scipy's L-BFGS-B; it is given the known
noise and no bias, which spares it what the others fit besides.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy import optimize, signal
from threadpoolctl import threadpool_limits

from benchmarks.campaigns import SETS, SIGMA_RAD_S, clean_rates, traces_from, white
from benchmarks.kept import Result, parser_of, print_and_write
from benchmarks.peers import DRAWING_BOARD, UPSAMPLING, Simulation, bound, jax_sysid, lmfit_output_error, ours
from benchmarks.peers import scipy_least_squares as least_squares
from identify.signals.trace import Trace
from rig.arrays import Array

START_VARIANCE = 1.0  # of angle and rate in rad and rad/s: unknown
PROCESS = 1e-14  # variance of a step, so that the filter has one
Tool = Callable[[Sequence[Trace], Array], Array]


def kalman(traces: Sequence[Trace], start: Array) -> Array:
    """The likelihood of all sets by statsmodels' filter, maximised over J, C and K."""
    from statsmodels.tsa.statespace.kalman_filter import KalmanFilter  # noqa: PLC0415

    simulation = Simulation(traces)
    n = simulation.measured.shape[1]
    torques = [np.asarray(spline(simulation.grid)) for spline in simulation.splines]
    spans = [np.lib.stride_tricks.sliding_window_view(u, UPSAMPLING + 1)[::UPSAMPLING] for u in torques]
    filters = []
    for y in simulation.measured:
        one = KalmanFilter(k_endog=1, k_states=2)
        one.bind(y[:, None])
        one["design"], one["obs_cov"] = np.array([[0.0, 1.0]]), np.array([[SIGMA_RAD_S**2]])
        one["selection"], one["state_cov"] = np.eye(2), PROCESS * np.eye(2)
        one.initialize_known(np.zeros(2), START_VARIANCE * np.eye(2))
        filters.append(one)

    def cost(x: Array) -> float:
        j, c, k = x * start[:3]
        fine, first, second = _foh(j, c, k, simulation.fine_s)
        weights = np.zeros((UPSAMPLING + 1, 2))
        power = np.eye(2)
        for i in range(UPSAMPLING - 1, -1, -1):
            weights[i] += power @ first
            weights[i + 1] += power @ second
            power = power @ fine
        total = 0.0
        for one, span in zip(filters, spans, strict=True):
            intercept = np.zeros((2, n))
            intercept[:, :-1] = (span @ weights).T
            one["transition"], one["state_intercept"] = power, intercept
            total -= one.loglike()
        return total

    bounds = [(0.2, 5.0)] * 3
    found = optimize.minimize(cost, np.ones(3), method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-14})
    better = optimize.minimize(cost, found.x, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-4})
    return np.asarray(better.x * start[:3])


def _foh(j: float, c: float, k: float, step_s: float) -> tuple[Array, Array, Array]:
    """Transition over a fine step, and the weights of the torque at its begin and end."""
    a = np.array([[0.0, 1.0], [-k / j, -c / j]])
    system = signal.StateSpace(a, np.array([[0.0], [1.0 / j]]), np.eye(2), np.zeros((2, 1)))
    held = system.to_discrete(step_s, "foh")  # whose state is shifted by D u
    second = held.D[:, 0]
    return held.A, held.B[:, 0] - held.A @ second, second


TOOLS: dict[str, tuple[Tool, str | None]] = {
    "isp-rig": (ours, None),
    "lmfit output error": (lmfit_output_error, "lmfit"),
    "scipy least_squares": (least_squares, None),
    "jax-sysid": (jax_sysid, "jax_sysid"),
    "statsmodels Kalman likelihood": (kalman, "statsmodels"),
}
EQUAL = 2.0  # times our rms error up to which a tool is compared by its time; widened from 1.5, see docs/benchmarks.md
SMALL = ("isp-rig", "lmfit output error", "scipy least_squares")


def measured(runs: int, tools: Sequence[str]) -> Result:
    """Mean time and rms error of every tool on ``runs`` campaigns, each a seed of its own."""
    truth, limit = bound(False)
    rates = clean_rates()
    table: list[dict[str, Any]] = []
    for name in tools:
        tool, package = TOOLS[name]
        if package is not None and find_spec(package) is None:
            table.append({"tool": name, "s": None})
            continue
        errors, took = [], []
        for run in range(-1, runs):  # the first compiles, and does not count
            traces = traces_from(rates, white(np.random.default_rng([7, max(run, 0)])))
            began = time.perf_counter()
            found = tool(traces, np.array(DRAWING_BOARD[:3]))
            if run >= 0:
                took.append(time.perf_counter() - began)
                errors.append(found / truth - 1.0)
        off = np.sqrt(np.mean(np.square(errors), axis=0))
        over = off / limit
        table.append(
            {"tool": name, "s": float(np.median(took))}
            | {f"{term} %": 100.0 * float(e) for term, e in zip("JCK", off, strict=True)}
            | {f"{term} over bound": float(e) for term, e in zip("JCK", over, strict=True)}
        )
    return Result("estimation", {"runs": runs, "sets": len(SETS)}, list(range(runs)), _ratios(table), table)


def _ratios(table: Sequence[dict[str, Any]]) -> dict[str, float]:
    """How many times faster than each tool that is about as accurate."""
    mine = table[0]
    out = {}
    for row in table[1:]:
        if row["s"] is not None and all(row[f"{t} over bound"] < EQUAL * mine[f"{t} over bound"] for t in "JCK"):
            out[f"times faster than {row['tool']}"] = row["s"] / mine["s"]
    return out


def result_of(small: bool) -> Result:
    """The table at its size."""
    with threadpool_limits(1):
        return measured(3, SMALL) if small else measured(5, tuple(TOOLS))


def main() -> None:
    """Print the table."""
    given = parser_of(__doc__).parse_args()
    print_and_write(result_of(given.small), given.out, given.small)


if __name__ == "__main__":
    main()
