"""Fits over whole runs, and where else one may begin that has stopped in a false minimum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.cross_validation import start_values
from identify.estimate.initial_guess import scale_of
from identify.estimate.output_error import Estimate, refine, squares_at
from identify.estimate.profile_likelihood import settled
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.propose.screening import Screen
from identify.runs.holdout import Split
from identify.select.criterion import STILL_FAR
from identify.select.free_run_fit import ENDS_NEAR, Whole, measured
from identify.signals.spectral_lines import foreign_lines_hz, ringing_hz, rings_hz
from identify.signals.trace import Trace
from identify.simulate.shots import Shots
from rig import effects
from rig.effects.base import Scale
from rig.platform import TERMS

TAKEN_ON = 4  # times as many as a fit has, while each time the squares fall
GOING = 0.95  # to less than this share
WALKED = 2  # times that other minima are looked for from the best so far
WELL_BEHIND = 1.2  # times the best error of the round after three steps of a large start
OUT_OF_SIGHT = 10.0  # the same of any other: a sharp resonance is arrived at late, and then at once
TOLERANCE = 3e-4
STEPS = 15
MOST_SIMULATIONS = 10_000  # of all runs: what the slowest searches cost that found what there was, twice
WORTH_A_FIT = 15.0  # expected fall of chi square


class Fits:
    """Fits to the samples of one recording that fit, compared on equal terms.

    Parameters
    ----------
    traces, split
        The runs, and which of their samples fit and judge.
    already
        How many effects a model may have before another one cannot be the large one any more.
    """

    def __init__(self, traces: Sequence[Trace], split: Split, already: int = 1) -> None:
        self.traces, self.split, self.already = traces, split, already
        on = [i for i, m in enumerate(split.fit) if np.any(m)]
        self.fitting, self.use = [traces[i] for i in on], [split.fit[i] for i in on]
        self.noise = float(np.sqrt(np.mean([t.noise**2 for t in traces])))
        self.torque_free = all(t.torque is None for t in traces)
        self.fixed: list[Name] = [("inertia",)] if self.torque_free else []
        self.finer = 1  # times the fine steps that models are compared with
        self.simulations = 0.0  # spent on fits so far: of all runs, as finely as the first model was
        self._once = 0.0  # fine steps of one
        self.horizon = 1.0  # of a first fit over short runs, in seconds
        self.moving = float(
            np.std(np.concatenate([t.measured[m] for t, m in zip(self.fitting, self.use, strict=True)]))
        )

    def whole(
        self, structure: Structure, start: Mapping[Name, float], hopeless: float = np.inf, steps: int = STEPS
    ) -> Whole | None:
        """A structure fitted over whole runs; None where it runs away.

        ``hopeless`` is the root mean square above which the fit is given up after three steps.
        """
        estimate = refine(
            self.fitting, structure, start, None, steps, self.use, fixed=self.fixed, coarse=True,
            tolerance=TOLERANCE, hopeless=hopeless, finer=self.finer,
        )  # fmt: skip
        self._spend(estimate)
        return measured(self.traces, self.split, estimate, self.noise, self.finer)

    def settled(self, fitted: Whole) -> Whole:
        """A fit near the noise, at the bottom of the valley where its inertia hardly shows."""

        def refit(
            values: Mapping[Name, float], *, rests: bool, held: Sequence[Name] = (),
            carry: Sequence[Shots] | None = None,
        ) -> Estimate:  # fmt: skip
            estimate = refine(
                self.fitting, fitted.structure, values, None, STEPS, self.use, carry, [*self.fixed, *held],
                TOLERANCE, coarse=True, finer=self.finer, rests=rests,
            )  # fmt: skip
            self._spend(estimate)
            return estimate

        bottom, _ = settled(fitted.estimate, self.noise, refit)
        if bottom is fitted.estimate:
            return fitted
        at_bottom = measured(self.traces, self.split, bottom, self.noise, self.finer)
        return fitted if at_bottom is None else replace(at_bottom, unsettled=fitted.squares)

    def _spend(self, estimate: Estimate) -> None:
        self._once = self._once or float(sum(s.grid.n for s in estimate.shots))
        self.simulations += estimate.work / self._once

    def gives_up(self, best: Whole) -> bool:
        """Whether a search has cost so much that no more is tried, with the best of its models far from the noise.

        What is in the library comes near the noise long before; what is not would be tried against all of it. Nothing
        comes to the noise in a decay, which is searched by its own rules.
        """
        return not self.torque_free and best.level > ENDS_NEAR and self.simulations > MOST_SIMULATIONS

    def squares(self, structure: Structure, values: Mapping[Name, float], finer: int | None = None) -> float:
        """Sum of squares over the noise's variance of a model as it is, fitted in its start states alone."""
        return squares_at(self.fitting, structure, values, self.use, finer or self.finer) / self.noise**2

    def by_way_of_a_short_horizon(
        self, structure: Structure, start: Mapping[Name, float], hopeless: float = np.inf, steps: int = STEPS
    ) -> Whole | None:
        """A structure fitted over whole runs, from where a short horizon leads: few starts are lost on that."""
        near = refine(
            self.fitting, structure, start, self.horizon, 8, self.use, fixed=self.fixed, coarse=True, tolerance=1e-3
        )
        self._spend(near)
        if np.isfinite(near.sigma):
            start = dict(zip(near.names, near.values.tolist(), strict=True))
        return self.whole(structure, start, hopeless, steps)

    def taken_on(self, fitted: Whole) -> Whole:
        """A fit that still goes down, taken on: a sharp resonance is found late, and then at once."""
        for _ in range(TAKEN_ON):
            if fitted.estimate.converged or fitted.at_noise:
                break
            further = self.whole(fitted.structure, fitted.values())
            if further is None or further.squares >= fitted.squares:
                break
            slow, fitted = further.squares > GOING * fitted.squares, further
            if slow:
                break
        return fitted

    def anew(self, fitted: Whole) -> Whole:
        """A fit that is done; far from the noise begun anew by way of a short horizon, for it may creep in a valley."""
        if fitted.level > STILL_FAR:
            other = self.by_way_of_a_short_horizon(fitted.structure, fitted.values())
            if other is not None and other.squares < fitted.squares:
                fitted = other
        return self.taken_on(fitted)

    def elsewhere(self, now: Whole, name: str) -> Whole:
        """The same effects, one of them begun where its other minima may lie: the best of all fits.

        From a better one it is looked for again: a mode that slow torque hardly tells from others is walked up to.
        """
        effect, best = effects.get(name), now
        for _ in range(WALKED if effect.other_minima and not self.torque_free else 0):  # a decay tells no inertia
            at, values = best, best.values()
            jck = tuple(values.get((t,), 0.0) for t in TERMS)
            own = tuple(values[(name, p.name)] for p in effect.parameters)
            others = effect.other_minima(jck, own, self.scale(at)) if effect.other_minima else ()  # type: ignore[arg-type]
            for other in others:
                start: dict[Name, float] = dict(values)
                start |= {(t,): v for t, v in other.terms.items()}
                start |= {(name, p): v for p, v in other.own.items()}
                there = best.at_noise and not now.at_noise
                fitted = None if there else self.whole(now.structure, start, OUT_OF_SIGHT * best.estimate.sigma)
                if fitted is not None and fitted.squares < best.squares:
                    best = self.taken_on(fitted)
            if best.at_noise or best.squares > GOING * at.squares:  # at the noise once is enough
                break
        return best

    def as_seen(
        self, screen: Screen, name: str, structure: Structure, values: Mapping[Name, float], best_error: float = np.inf
    ) -> Whole | None:
        """A candidate fitted from where the regression along the measured motion sees it.

        ``best_error`` is the best of the round, if there is one: what is far behind it after three steps is given up.
        """
        look = screen.look(name)
        if look is None or look.gain < WORTH_A_FIT:
            return None
        start = start_values(screen.solution(look), look.shapes, 1 + max(t.number for t in self.traces))
        return self.whole(structure.plus(name), {**values, **start}, OUT_OF_SIGHT * best_error)

    def or_large(self, name: str, now: Whole, small: Whole | None, best_error: float) -> Whole | None:
        """The same from where the effect is no small addition, while the fit is not near the noise.

        ``best_error`` is the best of the round: what is well behind it after three steps has begun in a wrong place.
        """
        effect, best, values = effects.get(name), small, now.values()
        if self.torque_free or len(now.structure.effects) > self.already:
            return small  # a third effect that is no small addition would have come before
        jck = tuple(values.get((t,), 0.0) for t in TERMS)
        for large in effect.large_starts(jck, self.scale(now)) if effect.large_starts else ():  # type: ignore[arg-type]
            if best is not None and best.level < ENDS_NEAR:
                break
            start: dict[Name, float] = dict(values)
            start |= {(t,): v for t, v in large.terms.items()}
            start |= {(name, p): v for p, v in large.own.items()}
            other = self.by_way_of_a_short_horizon(now.structure.plus(name), start, WELL_BEHIND * best_error)
            best = min((w for w in (best, other) if w is not None), key=lambda w: w.squares, default=None)
        return best

    def scale(self, now: Whole) -> Scale:
        """How large the motion is, and the lines in it, as a model's residuals show them."""
        values, traces = now.values(), self.fitting
        inertia, damping, stiffness = (values.get((t,), 0.0) for t in TERMS)
        natural_hz = float(np.sqrt(max(stiffness, 0.0) / max(inertia, 1e-300)) / (2.0 * np.pi))
        lines = foreign_lines_hz(traces, now.estimate.residuals(), self.noise, natural_hz)
        return scale_of(
            traces,
            (inertia, damping, stiffness),
            lines,
            ringing_hz(traces, natural_hz),
            rings_hz(traces, now.estimate.residuals(), natural_hz),
        )
