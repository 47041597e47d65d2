"""Unknown torque delays from 0 to 3 ms: how well they, and the damping that they bend, are recovered.

python -m benchmarks.delays --runs 10

The motion is the closed solution, shifted; the fit knows nothing of the delay but that there may be one.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.campaigns import DELAY, DELAY_NAME, TRUTH, clean_rates, structure_with, traces_from, white
from identify.estimate.final_fit import by_output_error
from identify.estimate.initial_guess import best_rho, first_guess
from identify.estimate.starting_point import horizon_s, start_values

DELAYS_MS = (0.0, 0.137, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
FIRST_LOOKS_S = (1e-4, 3e-4, 1e-3, 3e-3)  # the delay's own starting values at 1 kHz and one below
MOST_US, MOST_C = 2.0, 3.0


@dataclass(frozen=True)
class Row:
    """One delay: errors over the campaigns, and of the plain fit that knows no delay."""

    delay_ms: float
    rms_us: float
    worst_percent: dict[str, float]
    plain_c_percent: float


def measure(delay_ms: float, runs: int, seed: int = 0) -> Row:
    """Fit ``runs`` campaigns with one delay."""
    rates = clean_rates(1e-3 * delay_ms)
    structure = structure_with(True)
    off, errors, plain = [], [], 0.0
    for run in range(runs):
        traces = traces_from(rates, white(np.random.default_rng([seed, round(1e3 * delay_ms), run])))
        guess = first_guess(traces, structure.minus(DELAY))
        looks = [({DELAY: (d,)}, best_rho(traces, structure, {DELAY: (d,)}, guess)) for d in FIRST_LOOKS_S]
        shapes, best = min(looks, key=lambda look: look[1].cost)
        use = [t.keep for t in traces]
        horizon = horizon_s(guess.platform, traces)
        values = by_output_error(traces, structure, start_values(best, shapes, len(traces)), horizon, use, use).values
        off.append(1e6 * values[DELAY_NAME] - 1e3 * delay_ms)
        errors.append([100.0 * abs(values[(n,)] / v - 1.0) for n, v in TRUTH.items()])
        if run == 0:
            bare = best_rho(traces, structure_with(False), {}, guess)
            plain = 100.0 * (bare.jck[1] / TRUTH["damping"] - 1.0)
    worst = dict(zip(TRUTH, np.max(errors, axis=0).tolist(), strict=True))
    return Row(delay_ms, float(np.sqrt(np.mean(np.square(off)))), worst, plain)


def text(rows: Sequence[Row]) -> str:
    """A markdown table."""
    lines = [
        "| delay ms | rms error us | worst J % | worst C % | worst K % | C % with no delay declared |",
        "|---" * 6 + "|",
    ]
    for r in rows:
        worst = " | ".join(f"{v:.2g}" for v in r.worst_percent.values())
        lines.append(f"| {r.delay_ms:g} | {r.rms_us:.3f} | {worst} | {r.plain_c_percent:+.3g} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    given = parser.parse_args()
    with threadpool_limits(1):
        rows = [measure(delay, given.runs) for delay in DELAYS_MS]
    print(text(rows))
    good = all(r.rms_us <= MOST_US and r.worst_percent["damping"] <= MOST_C for r in rows)
    print(f"\nwithin {MOST_US:g} us rms and {MOST_C:g} % of C at every delay: {'yes' if good else 'NO'}")


if __name__ == "__main__":
    main()
