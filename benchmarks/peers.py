"""The same campaigns through other tools: one table, one command.

pip install lmfit jax-sysid     # into an environment of their own: they hold numpy and scipy back
python -m benchmarks.peers --runs 3

Each tool fits J, C, K, (where there is one) the delay, and start angle, start rate and bias of every set, by output
error. The peers are given an exact simulation (scipy's first-order hold on a torque upsampled by a cubic spline;
jax-sysid integrates itself) and their user is taken to have declared the right effect. Started from drawing-board
values, and from our regression. The Stribeck campaign is left out for them: they have no stick-slip model.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import optimize, signal
from scipy.interpolate import CubicSpline
from threadpoolctl import threadpool_limits

from benchmarks.campaigns import (
    DELAY_NAME,
    SAMPLE_S,
    SETS,
    TRUTH,
    clean_rates,
    fitted,
    regression_start,
    structure_with,
    times,
    traces_from,
    white,
)
from identify.bounds.cramer_rao import information_of, together
from identify.signals.trace import Trace
from rig.arrays import Array
from rig.platform import Platform

UPSAMPLING = 8
DELAY_S = 1.5e-3
DRAWING_BOARD = (0.0185, 0.06, 650.0, 0.5e-3)  # J, C, K, delay: as one would declare them
NUISANCES = 3  # start angle, start rate, bias of every set
EPOCHS = 300  # of jax-sysid's L-BFGS
Tool = Callable[[Sequence[Trace], Array], Array]  # measured sets and a start (J, C, K[, delay]) to the same


class Simulation:
    """A linear platform under sampled torques, exact but for the torque's spline; shared by lmfit and scipy."""

    def __init__(self, traces: Sequence[Trace]) -> None:
        t = times()
        self.fine_s = SAMPLE_S / UPSAMPLING
        self.grid = self.fine_s * np.arange((len(t) - 1) * UPSAMPLING + 1)
        self.splines = [CubicSpline(t, np.interp(t, x.run.torque_time_s, x.run.torque_nm)) for x in traces]  # type: ignore[arg-type]
        self.measured = np.stack([x.measured for x in traces])

    def rates(self, theta: Array, starts: Array) -> Array:
        """Rate of every set, (sets, n), from J, C, K[, delay] and start angle, start rate and bias of each."""
        j, c, k = theta[:3]
        late = theta[3] if len(theta) > 3 else 0.0
        a = np.array([[0.0, 1.0], [-k / j, -c / j]])
        system = signal.StateSpace(a, np.array([[0.0], [1.0 / j]]), np.array([[0.0, 1.0]]), np.zeros((1, 1)))
        discrete = system.to_discrete(self.fine_s, "foh")
        top, bottom = signal.ss2tf(discrete.A, discrete.B, discrete.C, discrete.D)
        power, axes = np.linalg.eig(a)
        free = np.exp(np.outer(times(), power))
        out = []
        for spline, (angle, rate, bias) in zip(self.splines, starts, strict=True):
            torque = spline(np.maximum(self.grid - late, 0.0))
            forced = signal.lfilter(top[0], bottom, torque)[::UPSAMPLING]
            ring = (free * np.linalg.solve(axes, [angle, rate]) @ axes[1]).real
            out.append(forced + ring + bias)
        return np.array(out)

    def residual(self, theta: Array, starts: Array) -> Array:
        """Simulated minus measured, all sets in a row; large where the simulation ran away."""
        with np.errstate(all="ignore"):
            off = (self.rates(theta, starts) - self.measured).ravel()
        return np.nan_to_num(off, nan=1e6, posinf=1e6, neginf=-1e6)


def ours(traces: Sequence[Trace], start: Array) -> Array:
    """This project: regression, then output error; takes no start."""
    structure = structure_with(len(start) > 3)
    found = fitted(traces, structure, regression_start(traces, structure))
    names = [(n,) for n in TRUTH] + ([DELAY_NAME] if len(start) > 3 else [])
    return np.array([found.values[n] for n in names])


def scipy_least_squares(traces: Sequence[Trace], start: Array) -> Array:
    """scipy.optimize.least_squares, parameters scaled by their start."""
    simulation, p = Simulation(traces), len(start)
    first = np.concatenate([np.ones(p), np.zeros(NUISANCES * len(traces))])

    def residual(x: Array) -> Array:
        return simulation.residual(x[:p] * start, x[p:].reshape(-1, NUISANCES))

    found = optimize.least_squares(residual, first, x_scale="jac", xtol=1e-12, ftol=1e-12, max_nfev=60)
    return np.asarray(found.x[:p] * start)


def lmfit_output_error(traces: Sequence[Trace], start: Array) -> Array:
    """lmfit.minimize (leastsq), J kept positive."""
    import lmfit  # noqa: PLC0415  (a peer, not a dependency)

    simulation, p = Simulation(traces), len(start)
    parameters = lmfit.Parameters()
    for i in range(p):
        parameters.add(f"p{i}", value=1.0, min=1e-3 if i == 0 else -np.inf)
    for i in range(NUISANCES * len(traces)):
        parameters.add(f"n{i}", value=0.0)

    def residual(q: Any) -> Array:
        x = np.array([v.value for v in q.values()])
        return simulation.residual(x[:p] * start, x[p:].reshape(-1, NUISANCES))

    found = lmfit.minimize(residual, parameters, max_nfev=2000, ftol=1e-12, xtol=1e-12)
    return np.array([found.params[f"p{i}"].value for i in range(p)]) * start


def jax_sysid(traces: Sequence[Trace], start: Array) -> Array:
    """jax-sysid's CTModel: all sets as one system of two states each, L-BFGS; without a delay, which it has not."""
    import diffrax  # type: ignore[import-not-found]  # noqa: PLC0415
    import jax  # type: ignore[import-not-found]  # noqa: PLC0415

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp  # type: ignore[import-not-found]  # noqa: PLC0415
    from jax_sysid.models import CTModel  # type: ignore[import-not-found]  # noqa: PLC0415

    if len(start) > 3:
        raise NotImplementedError("no delay")
    simulation, m = Simulation(traces), len(traces)
    speed = np.sqrt(start[2] / start[0])  # angle scaled by it, so that both states are of one size

    def slope(x: Any, u: Any, t: Any, params: Any) -> Any:
        j, c, k = (params[0][i] * start[i] for i in range(3))
        angle, rate = x[:m] / speed, x[m:]
        return jnp.concatenate([rate * speed, (u - c * rate - k * angle) / j])

    def output(x: Any, u: Any, t: Any, params: Any) -> Any:
        return x[m:] + params[1]

    model = CTModel(2 * m, m, m, state_fcn=slope, output_fcn=output)
    model.integration_options("linear", diffrax.Tsit5(), dt0=1e-3, max_steps=20_000)
    model.init(params=[np.ones(3), np.zeros(m)], x0=np.zeros(2 * m))
    model.loss(output_loss=lambda a, b: jnp.sum((a - b) ** 2), rho_x0=0.0, rho_th=0.0)
    model.optimization(adam_epochs=0, lbfgs_epochs=EPOCHS, iprint=-1, lbfgs_tol=1e-14, memory=20)
    torque = np.stack([s(times()) for s in simulation.splines], axis=1)
    model.fit(simulation.measured.T, torque, times())
    return np.asarray(model.params[0]) * start


TOOLS: dict[str, tuple[Tool, str | None]] = {
    "isp-rig": (ours, None),
    "scipy least_squares": (scipy_least_squares, None),
    "lmfit": (lmfit_output_error, "lmfit"),
    "jax-sysid": (jax_sysid, "jax_sysid"),
}


@dataclass(frozen=True)
class Row:
    """One tool from one start on one kind of campaign: rms errors in percent, and over the bound; None: failed."""

    tool: str
    campaign: str
    start: str
    percent: tuple[float, ...] | None
    over_bound: tuple[float, ...]
    seconds: float
    note: str = ""


def bound(delay: bool) -> tuple[Array, Array]:
    """True values, and the relative Cramer-Rao bound of the joint fit."""
    platform = Platform(*TRUTH.values(), {"torque_delay": {"delay": DELAY_S}} if delay else {})
    rates = clean_rates(DELAY_S if delay else 0.0)
    traces = traces_from(rates, [np.zeros_like(r) for r in rates], lead_in_s=0.0)  # the start state holds at 0 s
    total = together([information_of(t, platform, len(SETS), (0.0, 0.0)) for t in traces])
    return total.values, np.array([total.relative(n) for n in total.names])


def measure(tool: str, delay: bool, from_regression: bool, runs: int) -> Row:
    """One tool on ``runs`` campaigns."""
    run_tool, package = TOOLS[tool]
    campaign = "1.5 ms delay" if delay else "J, C, K"
    begin = "regression" if from_regression else "drawing board"
    if package is not None and importlib.util.find_spec(package) is None:
        return Row(tool, campaign, begin, None, (), 0.0, "not installed")
    truth, limit = bound(delay)
    rates = clean_rates(DELAY_S if delay else 0.0)
    errors, took = [], 0.0
    for run in range(runs):
        traces = traces_from(rates, white(np.random.default_rng([7, run])))
        start = np.array(DRAWING_BOARD[: len(truth)])
        if from_regression and tool != "isp-rig":
            structure = structure_with(delay)
            given = regression_start(traces, structure)
            start = np.array([given[(n,)] for n in TRUTH] + ([given[DELAY_NAME]] if delay else []))
        began = time.perf_counter()
        try:
            found = run_tool(traces, start)
        except NotImplementedError as error:
            return Row(tool, campaign, begin, None, (), 0.0, str(error))
        took += time.perf_counter() - began
        errors.append(found / truth - 1.0)
    off = np.sqrt(np.mean(np.square(errors), axis=0))
    return Row(tool, campaign, begin, tuple(100.0 * off), tuple(off / limit), took / runs)


def line(row: Row) -> str:
    """One row of the table."""
    if row.percent is None:
        return f"| {row.campaign} | {row.tool} | {row.start} | {row.note} | | | | | |"
    errors = " | ".join(f"{v:.2g}" for v in row.percent[:3])
    delay = f"{row.percent[3] * DELAY_S * 1e4:.2g}" if len(row.percent) > 3 else ""
    ratios = ", ".join(f"{v:.3g}" for v in row.over_bound[:3])
    return f"| {row.campaign} | {row.tool} | {row.start} | {errors} | {delay} | {ratios} | {row.seconds:.1f} |"


def main() -> None:
    """Print the table, a row as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--tools", nargs="+", default=list(TOOLS), choices=list(TOOLS))
    given = parser.parse_args()
    print("| campaign | tool | start | J % | C % | K % | delay us | error over bound J, C, K | s |")
    print("|---" * 9 + "|")
    with threadpool_limits(1):
        for delay in (False, True):
            for tool in given.tools:
                for from_regression in (True,) if tool == "isp-rig" else (False, True):
                    print(line(measure(tool, delay, from_regression, given.runs)), flush=True)


if __name__ == "__main__":
    main()
