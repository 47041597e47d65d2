"""The declared Stribeck model of the paper (Eq. 7), on data that an independent event-driven integrator made.

python -m benchmarks.stribeck

Declared values are wrong by the given factors; the declared model, and no other effect, is fitted. Residuals
are those of a free run over each whole set from one fitted start state, over the gyro's noise.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.campaigns import SETS, SIGMA_RAD_S, TRUTH, run_of, times
from benchmarks.stick_slip import StickSlip
from identify.pipeline import identify
from rig.arrays import Array
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording

FRICTION = {"coulomb": 1.2, "static": 2.4, "speed": 0.08}
FACTORS = (0.33, 1.0, 3.0)
MOST_SIGMA, MOST_C = 1.1, 3.0
NAME = "stribeck_friction"


@dataclass(frozen=True)
class Fit:
    """One identification: residual of every set over the noise, and errors in percent."""

    factor: float
    sigmas: tuple[float, ...]
    percent: dict[str, float]
    seconds: float

    @property
    def passes(self) -> bool:
        """Residual at the noise and C right."""
        return max(self.sigmas) <= MOST_SIGMA and abs(self.percent.get("damping", math.inf)) <= MOST_C


def rates(sets: Sequence[tuple[float, float]] = SETS, duration_s: float = 10.0) -> list[Array]:
    """The rate of every set with the true friction, from rest."""
    truth = StickSlip(*TRUTH.values(), **FRICTION)
    out = []
    for amplitude, f in sets:
        out.append(truth.rate(lambda t, a=amplitude, f=f: a * math.sin(2 * math.pi * f * t), times(duration_s)))  # type: ignore[misc]
    return out


def recording(clean: Sequence[Array], seed: int, sets: Sequence[tuple[float, float]] = SETS) -> Recording:
    """Noisy runs."""
    rng = np.random.default_rng(seed)
    noisy = [r + SIGMA_RAD_S * rng.standard_normal(len(r)) for r in clean]
    return Recording(tuple(run_of(r, a, f) for r, (a, f) in zip(noisy, sets, strict=True)))


def fit(data: Recording, factor: float) -> Fit:
    """Identify with every declared friction value wrong by ``factor``."""
    declared = Platform(0.0185, 0.06, 650.0, {NAME: {k: v * factor for k, v in FRICTION.items()}})
    began = time.perf_counter()
    found = identify(data, declared, IdentifyConfig(candidates=()))
    took = time.perf_counter() - began
    sigmas = []
    for run in found.traces:
        off = (run.measured - run.simulated_before)[run.keep > 0]
        sigmas.append(float(np.sqrt(np.mean(off**2))) / SIGMA_RAD_S)
    model = found.before
    values = {n: p.value for n, p in model.parameters.items()}
    values |= {n: p.value for n, p in model.effect_parameters.get(NAME, {}).items()}
    true = {**TRUTH, **FRICTION}
    return Fit(factor, tuple(sigmas), {n: 100.0 * (v / true[n] - 1.0) for n, v in values.items()}, took)


def text(fits: Sequence[Fit]) -> str:
    """A markdown table."""
    head = ["friction declared times", *(f"{f:g} Hz" for _, f in SETS), *(f"{n} %" for n in (*TRUTH, *FRICTION)), "s"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for fit in fits:
        errors = [f"{fit.percent[n]:+.3g}" if n in fit.percent else "-" for n in (*TRUTH, *FRICTION)]
        cells = [f"{fit.factor:g}", *(f"{s:.3f}" for s in fit.sigmas), *errors, f"{fit.seconds:.0f}"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--factors", type=float, nargs="+", default=FACTORS)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    data = recording(rates(), given.seed)
    fits = [fit(data, factor) for factor in given.factors]
    print(text(fits))
    good = sum(f.passes for f in fits)
    print(f"\n{good} of {len(fits)} starts end within {MOST_SIGMA} times the noise and {MOST_C} % of C")


if __name__ == "__main__":
    main()
