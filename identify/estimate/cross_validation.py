"""Models side by side: each fitted by output error over a short horizon, judged on samples not fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.estimate.evaluation import evaluate
from identify.estimate.output_error import Estimate, refine
from identify.estimate.regression import Solution
from identify.model.parameters import Name, names_of
from identify.model.structure import Shapes, Structure
from identify.signals.trace import Trace
from rig import effects
from rig.effects.base import Place
from rig.platform import TERMS
from rig.recording.run import Array

ABOVE = 0.02  # of the noise's square: less than that above the floor is the floor
NOTHING = 1e-290  # of information: what a parameter without any influence leaves of rounding
CLEARLY = 2.5  # standard errors by which the held-out error must fall


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

    def _neutral(self, name: str) -> Array:
        """Values at which an effect is none, zero for all that is not its own, (p,)."""
        none = {p.name: p.neutral for p in effects.get(name).parameters} if name not in TERMS else {}
        return np.array([none[n[1]] if n[0] == name and len(n) > 1 else 0.0 for n in self.estimate.names])

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")
    def strength(self, name: str) -> float:
        """How many standard errors, taken as white, a term or an effect stands from none.

        Of an effect's gains it is the joint distance (one of a sine and a cosine may well be nothing). Of its shapes
        it is the smallest, where some shape makes it a simpler effect. Elsewhere a shape that the data hardly know (a
        relaxation slower than all motion) is no reason to doubt the effect: its gains are taken at that shape.
        """
        covariance = self._covariance()
        if covariance is None:
            return 0.0
        linear = {p.name: p.linear for p in effects.get(name).parameters} if name not in TERMS else {}
        mine = [i for i, n in enumerate(self.estimate.names) if n[0] == name]
        gains = [i for i in mine if len(self.estimate.names[i]) == 1 or linear[self.estimate.names[i][1]]]
        shapes = [i for i in mine if i not in gains]
        x = self.estimate.values - self._neutral(name)
        out = []
        known: list[int] = []
        if gains and shapes and not effects.get(name).nests:
            known = shapes
        else:
            untold = self._untold()
            out = [0.0 if untold[i] else abs(x[i]) / float(np.sqrt(max(covariance[i, i], 1e-300))) for i in shapes]
        if gains:
            joint = _distance(self.estimate.information, x, gains, known) / self.estimate.sigma**2
            out.append(float(np.sqrt(max(joint, 0.0) / len(gains))))
        return float(min(out)) if np.all(np.isfinite(out)) else 0.0

    def shapes(self) -> dict[str, tuple[float, ...]]:
        """Shape parameters of every effect."""
        values = self.values()
        return {
            name: tuple(values[(name, p.name)] for p in effects.get(name).parameters if not p.linear)
            for name in self.structure.effects
        }


def _distance(information: Array, x: Array, gains: Sequence[int], known: Sequence[int]) -> float:
    """Squared distance of some parameters from zero in their own information, all others but ``known`` fitted anew.

    From the information itself: a phase that the data leave open takes an amplitude that they know well out of any
    inverse of it.
    """
    others = [i for i in range(len(x)) if i not in gains and i not in known]
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled, t = information / np.outer(size, size), (x * size)[gains]
    across = scaled[np.ix_(gains, others)]
    left = scaled[np.ix_(gains, gains)] - across @ np.linalg.pinv(
        scaled[np.ix_(others, others)], rcond=1e-12, hermitian=True
    ) @ across.T  # fmt: skip
    return float(t @ left @ t)


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


def rough(structure: Structure) -> bool:
    """Whether the error of a structure has false minima: dry friction, or shapes to be found."""
    found = [effects.get(name) for name in structure.effects]
    return any(e.place is Place.FRICTION or any(not p.linear for p in e.parameters) for e in found)


def judge(
    fitting: Sequence[Trace],
    judging: Sequence[Trace],
    structure: Structure,
    start: Mapping[Name, float],
    horizon: float,
    iterations: int = 8,
    hopeless: float = np.inf,
    rough_start: bool = True,
) -> Judged:
    """Fit on some pieces, then measure on others with nothing but start states fitted there."""
    torque_free = all(t.torque is None for t in fitting)
    fixed = [("inertia",)] if torque_free else []
    first = start
    if rough_start and rough(structure):  # a short horizon has fewer false minima
        near = refine(fitting, structure, start, 0.25 * horizon, 5, fixed=fixed, tolerance=1e-3, coarse=True)
        first = dict(zip(near.names, near.values.tolist(), strict=True)) if np.isfinite(near.sigma) else start
    estimate = refine(
        fitting, structure, first, horizon, iterations, fixed=fixed,
        tolerance=1e-3, coarse=True, hopeless=hopeless,
    )  # fmt: skip
    if not np.isfinite(estimate.sigma):
        return Judged(structure, estimate, np.array([np.inf]), np.ones(1))
    # Over a short horizon a tone with a phase of its own in every run follows the friction of a servo that swings.
    held = evaluate(estimate, judging, None, horizon, coarse=True, own_gains=False)
    losses, counts = [], []
    for shots, residual in zip(held.shots, held.residuals(), strict=True):
        for (a, b), on in zip(shots.edges, shots.active, strict=True):
            if on:
                r = residual[a:b][shots.weight[a:b]]
                losses.append(float(r @ r))
                counts.append(len(r))
    return Judged(structure, estimate, np.array(losses), np.array(counts, dtype=float))


def advantage(old: Judged, new: Judged) -> float:
    """By how many standard errors the new model's held-out error is lower, shots paired."""
    if not (np.all(np.isfinite(old.losses)) and np.all(np.isfinite(new.losses))):
        return 0.0 if np.all(np.isfinite(old.losses)) else float(np.all(np.isfinite(new.losses))) * np.inf
    d = (old.losses - new.losses) / np.maximum(np.sum(old.counts), 1)
    spread = float(np.std(d, ddof=1)) if len(d) > 1 else 0.0
    if spread == 0.0:
        return 0.0
    # A few shots with a huge gain must not make a gain everywhere look uncertain: ratios count too.
    ratio = np.log(np.maximum(old.losses, 1e-300) / np.maximum(new.losses, 1e-300))
    by_ratio = float(np.mean(ratio) / max(float(np.std(ratio, ddof=1)), 1e-12) * np.sqrt(len(d)))
    by_size = float(np.mean(d) / spread * np.sqrt(len(d)))
    return max(by_size, by_ratio) if np.sum(d) > 0.0 else min(by_size, 0.0)


def delta_bic(old: Judged, new: Judged) -> float:
    """BIC of the new model minus the old one's, on the samples fitted; negative is better."""
    n = old.estimate.count
    more = len(new.estimate.names) - len(old.estimate.names)
    return float(2.0 * n * np.log(new.estimate.sigma / old.estimate.sigma) + more * np.log(max(n, 2)))


def share_explained(old: Judged, new: Judged, floor: float) -> float:
    """Share of the held-out error above the noise floor that the new model takes away."""
    excess = old.sigma**2 - floor**2
    return float((old.sigma**2 - new.sigma**2) / excess) if excess > ABOVE * floor**2 else 0.0
