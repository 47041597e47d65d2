"""A model as the report and the final fits see it, whichever search found it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.estimate.output_error import Estimate
from identify.estimate.regression import Solution
from identify.model.parameters import Name, names_of
from identify.model.structure import Shapes, Structure
from identify.signals.trace import Trace
from rig import effects
from rig.recording.run import Array

ABOVE = 0.02  # of the noise's square: less than that above the floor is the floor
NOTHING = 1e-290  # of information: what a parameter without any influence leaves of rounding


@dataclass(frozen=True)
class Judged:
    """A structure with its fit and the squared error of every held-out shot."""

    structure: Structure
    estimate: Estimate
    losses: Array  # (shots,)
    counts: Array  # (shots,)

    @property
    def sigma(self) -> float:
        """Held-out error: the geometric mean over shots of their root mean square.

        A shot that begins next to a standstill can go the wrong way whatever the model; one such shot must
        not outweigh all others, and quiet shots, where friction shows, must count.
        """
        mean_square = np.maximum(self.losses, 1e-300) / np.maximum(self.counts, 1.0)
        return float(np.exp(0.5 * np.mean(np.log(mean_square))))

    def values(self) -> dict[Name, float]:
        """Parameter values by name."""
        return dict(zip(self.estimate.names, self.estimate.values.tolist(), strict=True))

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")
    def _covariance(self) -> Array | None:
        """Covariance of the parameters, errors taken as white; None where the fit ran away."""
        scale = np.sqrt(np.maximum(np.diag(self.estimate.information), 1e-300))
        scaled = self.estimate.information / np.outer(scale, scale)
        if not np.all(np.isfinite(scaled)):
            return None
        inverse = np.linalg.pinv(scaled, rcond=1e-12, hermitian=True)
        return np.asarray(inverse / np.outer(scale, scale) * self.estimate.sigma**2)

    def std_errors(self) -> dict[Name, float]:
        """Standard error of every parameter, errors taken as white; infinite where the fit or the data say nothing."""
        covariance = self._covariance()
        size = np.full(len(self.estimate.names), np.inf) if covariance is None else np.sqrt(
            np.maximum(np.diag(covariance), 0.0)
        )  # fmt: skip
        size[self._untold()] = np.inf
        return dict(zip(self.estimate.names, size.tolist(), strict=True))

    def _untold(self) -> Any:
        """Which parameters the data say nothing about, (p,): a limit that nothing reaches."""
        return ~(np.diag(self.estimate.information) > NOTHING)

    def shapes(self) -> dict[str, tuple[float, ...]]:
        """Shape parameters of every effect."""
        values = self.values()
        return {
            name: tuple(values[(name, p.name)] for p in effects.get(name).parameters if not p.linear)
            for name in self.structure.effects
        }


def horizon_s(platform: tuple[float, float, float], traces: Sequence[Trace]) -> float:
    """How far ahead a model has to predict while models are compared.

    Three periods of an oscillation, or the time constant of a platform without a spring: long enough for
    a missing effect to show, short enough that a model which is still wrong stays near the data.
    """
    j, c, k = platform
    shortest = 40.0 * max(t.step_s for t in traces)
    longest = 0.25 * min(t.step_s * len(t.measured) for t in traces)
    swings = k > 0.0 and c * c < 4.0 * j * k and np.sqrt(k / j) * longest > np.pi
    wanted = 6.0 * np.pi * np.sqrt(j / k) if swings else float(np.clip(j / max(abs(c), 1e-12), 0.3, 1.0))
    return float(np.clip(wanted, shortest, max(longest, shortest)))


def start_values(solution: Solution, shapes: Shapes, runs: int) -> dict[Name, float]:
    """A start for output error from a solved regression."""
    inertia, damping, stiffness = solution.platform
    terms = {"inertia": inertia, "damping": damping, "stiffness": stiffness}
    out: dict[Name, float] = {}
    for name in names_of(solution.structure, runs):
        if len(name) == 1:
            out[name] = terms[name[0]]
            continue
        effect = effects.get(name[0])
        parameter = next(p for p in effect.parameters if p.name == name[1])
        if parameter.linear:
            out[name] = float(np.clip(solution.value(*name), parameter.low, parameter.high))
        else:
            index = [p.name for p in effect.parameters if not p.linear].index(name[1])
            out[name] = float(shapes[name[0]][index])
    return out


def share_explained(old: Judged, new: Judged, floor: float) -> float:
    """Share of the held-out error above the noise floor that the new model takes away."""
    excess = old.sigma**2 - floor**2
    return float((old.sigma**2 - new.sigma**2) / excess) if excess > ABOVE * floor**2 else 0.0
