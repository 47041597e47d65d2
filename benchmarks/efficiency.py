"""How close the estimates come to the Cramer-Rao bound: root mean square error over bound, in simulated campaigns.

python -m benchmarks.efficiency --runs 200

The bound is that of the same model with its nuisances (start angle, start rate, gyro bias of every set)
counted in; beside it stands the bound with these known.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.campaigns import (
    DELAY,
    DELAY_NAME,
    SIGMA_RAD_S,
    TRUTH,
    alone,
    clean_rates,
    fitted,
    regression_start,
    structure_with,
    traces_from,
    white,
)  # fmt: skip
from identify.bounds.cramer_rao import Information, information_of, together
from identify.model.parameters import Name
from identify.signals.trace import Trace
from rig.arrays import Array
from rig.platform import Platform

DELAY_S = 1.5e-3
MOST_JOINT, MOST_ALONE = 1.10, 1.2


@dataclass(frozen=True)
class Row:
    """One parameter of one fit: relative root mean square error, bounds, and their ratio."""

    fit: str
    parameter: str
    error_percent: float
    bound_percent: float
    known_percent: float

    @property
    def ratio(self) -> float:
        """Error over bound; 1 is the physical limit."""
        return self.error_percent / self.bound_percent


def truth_of(names: Sequence[Name]) -> Array:
    """True values."""
    return np.array([DELAY_S if n == DELAY_NAME else TRUTH[n[0]] for n in names])


def bounds(delay: bool) -> list[Information]:
    """The information of every set at the truth, then of all together."""
    platform = Platform(*TRUTH.values(), {DELAY: {"delay": DELAY_S}} if delay else {})
    rates = clean_rates(DELAY_S if delay else 0.0)
    silent = traces_from(rates, [np.zeros_like(r) for r in rates], lead_in_s=0.0)  # the start state holds at 0 s
    each = [information_of(t, platform, len(silent), (0.0, 0.0)) for t in silent]
    return [*each, together(each)]


def errors(delay: bool, runs: int, seed: int) -> Array:
    """Relative errors, shape (runs, fits, parameters): every set alone, then all together."""
    structure = structure_with(delay)
    rates = clean_rates(DELAY_S if delay else 0.0)
    out = []
    for run in range(runs):
        traces = traces_from(rates, white(np.random.default_rng([seed, int(delay), run])))
        fits: list[list[Trace]] = [*(alone(t) for t in traces), traces]
        start = regression_start(traces, structure)
        rows = []
        for several in fits:
            found = fitted(several, structure, start)
            true = truth_of(found.names)
            rows.append(found.vector / true - 1.0)
        out.append(rows)
        print(f"\r{run + 1} of {runs} campaigns", end="", file=sys.stderr, flush=True)
    return np.array(out)


def compare(delay: bool, runs: int, seed: int = 0) -> list[Row]:
    """The table for one model."""
    off = np.sqrt(np.mean(errors(delay, runs, seed) ** 2, axis=0))
    rows = []
    for i, bound in enumerate(bounds(delay)):
        known = bound.if_known()
        for k, name in enumerate(bound.names):
            percent = (100.0 * off[i, k], 100.0 * bound.relative(name), 100.0 * known.relative(name))
            rows.append(Row(bound.name, name[-1], *percent))
    return rows


def text(rows: Sequence[Row], title: str) -> str:
    """The rows as a markdown table."""
    lines = [f"{title}, gyro noise {np.rad2deg(SIGMA_RAD_S):.2f} deg/s", ""]
    lines += [
        "| fit | parameter | rms error % | bound % | ratio | bound, start and bias known % |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r.fit} | {r.parameter} | {r.error_percent:.3g} | {r.bound_percent:.3g} | {r.ratio:.3f} "
        f"| {r.known_percent:.3g} |"
        for r in rows
    ]
    return "\n".join(lines)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--model", choices=("plain", "delay", "both"), default="both")
    given = parser.parse_args()
    with threadpool_limits(1):
        for delay, title in ((False, "J, C, K"), (True, "J, C, K and an unknown delay of 1.5 ms")):
            if given.model == ("plain" if delay else "delay"):
                continue
            rows = compare(delay, given.runs, given.seed)
            print(text(rows, f"{title}: {given.runs} campaigns"))
            joint = max(r.ratio for r in rows if r.fit == "all sets together" and r.parameter in TRUTH)
            single = max(r.ratio for r in rows if r.fit != "all sets together" and r.parameter in TRUTH)
            print(f"\nlargest ratio: {joint:.3f} jointly (at most {MOST_JOINT}), {single:.3f} alone ({MOST_ALONE})\n")


if __name__ == "__main__":
    main()
