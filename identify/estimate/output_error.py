"""Output error: the model simulated, compared with what the sensor really measured.

Each run is simulated in shots. One shot over a whole run is the maximum-likelihood fit for white sensor
noise; shorter shots, each with a start state of its own, keep a model that is still wrong close to the
data (multiple shooting).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.estimate.gauss_newton import GaussNewton, Step
from identify.model.parameters import Name, names_of, platform_of
from identify.model.structure import Structure
from identify.signals.trace import Trace
from identify.simulate.all_runs import shots_for
from identify.simulate.shots import Shots, predict
from rig import effects
from rig.dynamics import Equations
from rig.platform import Platform
from rig.recording.run import Array

KEPT = 3  # steps with the same sensitivities


@dataclass(frozen=True)
class Estimate:
    """A fitted output-error model.

    Attributes
    ----------
    sigma
        Root mean square of measured minus simulated over the samples that count.
    information
        Normal matrix of the global parameters, start states and bias eliminated, for unit noise.
    work
        Fine steps that were simulated on the way, each parameter's sensitivity counted as a simulation.
    """

    structure: Structure
    names: tuple[Name, ...]
    values: Array
    sigma: float
    count: int
    information: Array
    shots: tuple[Shots, ...]
    converged: bool
    work: float = 0.0

    def platform(self, run: int = 0, added: float = 0.0) -> Platform:
        """The fitted platform, as it stood in one run."""
        return platform_of(self.structure, self.names, self.values, run, added)

    def simulated(self) -> list[Array]:
        """The measured channel as the model gives it, one array a run."""
        return [predict(s, Equations(self.platform(s.number, s.added)), s.starts, s.bias) for s in self.shots]

    def residuals(self) -> list[Array]:
        """Measured minus simulated, one array a run."""
        return [s.trace.measured - y for s, y in zip(self.shots, self.simulated(), strict=True)]


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
    finer: int = 1,
    rests: bool = False,
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
    finer
        That many times the fine steps.
    rests
        Runs that begin at rest are held to it: their start states are not fitted.
    """
    names = names_of(structure, 1 + max(t.number for t in traces))
    x = np.array([start.get(name, 0.0) if len(name) == 3 else start[name] for name in names])
    still = held_still(names, traces, use, fixed)
    shots = shots_for(traces, structure, names, x, shot_s, use, carry, coarse, finer, rests)
    workers = ThreadPoolExecutor(2)
    try:
        return _levenberg(
            GaussNewton(workers, shots, structure, names, x, still), iterations, tolerance, hopeless, coarse
        )
    finally:
        workers.shutdown()


def held_still(names: Sequence[Name], traces: Sequence[Trace], use: Sequence[Any] | None, fixed: Sequence[Name]) -> Any:
    """Which parameters keep their start value, (p,).

    Those asked for, shapes that the size of the motion gives, and what belongs to a run without a sample.
    """
    seen = {str(t.number) for i, t in enumerate(traces) if use is None or np.any(use[i])}
    held = {
        (e, p.name) for e in {n[0] for n in names if len(n) > 1} for p in effects.get(e).parameters if not p.searched
    }
    return np.array([name in fixed or name in held or (len(name) == 3 and name[2] not in seen) for name in names])


def _levenberg(descent: GaussNewton, iterations: int, tolerance: float, hopeless: float, coarse: bool) -> Estimate:
    d, converged, left, age = descent, False, iterations, 0
    while left > 0 and not d.lost:
        if iterations - left >= 3 and d.cost > hopeless**2 * d.count:
            break
        step = d.step()
        left -= step is not None
        if step is None and d.fresh:
            converged = True
            break
        # Sensitivities from elsewhere lead beside the minimum, the further the more the model leaves.
        arrived = step is not None and _arrived(step, tolerance)
        age += 1
        if step is not None and d.fresh and arrived:
            converged = True
            d.keep() if coarse else d.renew()
            break
        if step is not None and step.foretold and not arrived and age <= KEPT:
            d.keep()
            continue
        age = 0
        d.renew()
    sigma = float(np.sqrt(d.cost / max(d.count, 1)))
    return Estimate(d.structure, d.names, d.x, sigma, d.count, d.a, tuple(d.shots), converged, d.work)


def _arrived(step: Step, tolerance: float) -> bool:
    return step.length <= 30.0 * tolerance or step.fall < 1e-2 * tolerance * step.cost
