"""Output error: the model simulated, compared with what the sensor really measured.

Each run is simulated in shots. One shot over a whole run is the maximum-likelihood fit for white sensor
noise; shorter shots, each with a start state of its own, keep a model that is still wrong close to the
data (multiple shooting).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from identify.estimate.gauss_newton import GaussNewton, Step
from identify.model.parameter_fit import ParameterFit, reduced_chi_square
from identify.model.parameters import Name, names_of
from identify.model.structure import Structure
from identify.signals.trace import Trace, pooled_noise
from identify.simulate.all_runs import shots_for
from identify.simulate.shots import Shots, predict
from rig import effects
from rig.dynamics import Equations
from rig.recording.run import Array

MAX_STEPS_ON_ONE_SENSITIVITY = 3  # steps with the same sensitivities


@dataclass(frozen=True)
class OutputErrorFit(ParameterFit):
    """A model fitted by output error; its cost is chi square.

    Attributes
    ----------
    noise
        One standard deviation of the measured channel, pooled over the runs.
    shots
        The runs with their start states and biases.
    held_out_squares, held_out_counts
        Squares of every run's held-out samples, in units of the channel squared, and how many those are, (runs,); empty
        where nobody has looked.
    """

    noise: float
    shots: tuple[Shots, ...]
    held_out_squares: Array = field(default_factory=lambda: np.zeros(0))
    held_out_counts: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def unfitted(cls, structure: Structure, names: tuple[Name, ...], vector: Array) -> OutputErrorFit:
        """Parameters that nothing was fitted with yet."""
        nothing = np.zeros((0, 0))
        return cls(structure, names, vector, 0, np.inf, np.inf, nothing, np.nan, ())

    def with_residual(self, squares: float, count: int, noise: float) -> OutputErrorFit:
        """The same with the squares that it leaves on so many samples."""
        variance = squares / max(count, 1)
        return replace(self, count=count, noise=noise, variance=variance, cost=chi_square(variance, count, noise))

    @property
    def reduced_chi_square(self) -> float:
        """Mean square of the residual over the noise's variance; one at the noise."""
        return reduced_chi_square(self.sigma, self.noise)

    @property
    def held_out_chi_square(self) -> float:
        """Squares of the held-out samples in units of the noise's variance."""
        return float(np.sum(self.held_out_squares)) / self.noise**2

    @property
    def held_out_error(self) -> float:
        """The geometric mean over runs of their root mean square on held-out samples; of all where none were held out.

        One that begins next to a standstill can go the wrong way whatever the model; it must not outweigh all others,
        and quiet ones, where friction shows, must count.
        """
        if not len(self.held_out_squares):
            return self.sigma
        mean_square = np.maximum(self.held_out_squares, 1e-300) / np.maximum(self.held_out_counts, 1.0)
        return float(np.exp(0.5 * np.mean(np.log(mean_square))))

    def simulated(self) -> list[Array]:
        """The measured channel as the model gives it, one array a run."""
        return [predict(s, Equations(self.platform(s.number, s.added)), s.starts, s.bias) for s in self.shots]

    def residuals(self) -> list[Array]:
        """Measured minus simulated, one array a run."""
        return [s.trace.measured - y for s, y in zip(self.shots, self.simulated(), strict=True)]


def chi_square(variance: float, count: int, noise: float) -> float:
    """Of a residual's mean square; infinite where the model ran away, or nothing is known of the noise."""
    return variance * count / noise**2 if np.isfinite(variance) and noise > 0.0 else np.inf


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
) -> OutputErrorFit:
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


def _levenberg(
    descent: GaussNewton, iterations: int, tolerance: float, hopeless: float, coarse: bool
) -> OutputErrorFit:
    d, left, age = descent, iterations, 0
    while left > 0 and not d.lost:
        if iterations - left >= 3 and d.cost > hopeless**2 * d.count:
            break
        step = d.step()
        left -= step is not None
        if step is None and d.fresh:
            break
        # Sensitivities from elsewhere lead beside the minimum, the further the more the model leaves.
        arrived = step is not None and _arrived(step, tolerance)
        age += 1
        if step is not None and d.fresh and arrived:
            d.keep() if coarse else d.renew()
            break
        if step is not None and step.foretold and not arrived and age <= MAX_STEPS_ON_ONE_SENSITIVITY:
            d.keep()
            continue
        age = 0
        d.renew()
    noise = pooled_noise([s.trace for s in d.shots])
    variance = d.cost / max(d.count, 1)
    cost = chi_square(variance, d.count, noise)
    return OutputErrorFit(d.structure, d.names, d.x, d.count, variance, cost, d.a, noise, tuple(d.shots))


def _arrived(step: Step, tolerance: float) -> bool:
    return step.length <= 30.0 * tolerance or step.fall < 1e-2 * tolerance * step.cost
