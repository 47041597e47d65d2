"""Find the residual, trace it to an effect, add it, look again: the loop itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.cross_validation import (
    CLEARLY,
    Judged,
    advantage,
    delta_bic,
    horizon_s,
    judge,
    share_explained,
    start_values,
)
from identify.estimate.effect_free import effect_free
from identify.estimate.initial_guess import Start, best_rho
from identify.estimate.regression import Solution
from identify.model.structure import Shapes, Structure
from identify.propose.screening import Screen, Screened, grid_of
from identify.results import Candidate
from identify.runs.measured_channels import simplicity
from identify.runs.observability import why_unseen
from identify.select.search_state import Search
from identify.signals.trace import Trace
from rig import effects
from rig.effects.base import Place
from rig.platform import TERMS

MOST_EFFECTS = 6
SHORTLIST = 4
WORTH = 0.2  # share of the excess error that an effect has to take away
MISSED = 0.1  # share of the squared error by which nobody doubts that a term is needed
BEGIN_AGAIN = 1.002  # times the floor above which the declared values are tried as a start as well
FAR_OFF = 3.0  # times what is declared: the declared values are tried as a start then as well
FAR = 10.0  # times the horizon
AGAIN = 1  # candidates of a round that are tried from other shapes
RESTARTS = 3
HOPELESS = 2.5  # times the best fit of the round: a candidate still above it after three steps is given up
NEAR = 1.5  # times the noise floor: from here on the screen looks behind the model's effects
MOST = 0.4  # share of the excess error beyond which one standard error is lead enough
TWICE = 2.0
STRONG = 4.0  # standard errors by which every parameter of a new effect must differ from zero
CERTAIN = 100.0  # standard errors beyond which nobody asks whether a term is needed
SUPPORT = 0.02  # share of the error by which a term must be missed to stay


def _far_off(found: Sequence[float], declared: Sequence[float] | None) -> bool:
    """Whether J or K came out far from what is declared: of two minima this may be the other."""
    pairs = [] if declared is None else [(found[i], declared[i]) for i in (0, 2) if declared[i] > 0.0]
    return any(not 1.0 / FAR_OFF < a / b < FAR_OFF for a, b in pairs)


class Loop:
    """The search over structures on one recording's pieces."""

    def __init__(
        self,
        fitting: Sequence[Trace],
        judging: Sequence[Trace],
        start: Start,
        allowed: Sequence[str],
        say: Callable[[str], None],
        whole: Sequence[Trace] | None = None,
    ) -> None:
        self.whole = whole or fitting  # spectral lines want the longest stretches there are
        self.fitting, self.judging, self.start, self.say = fitting, judging, start, say
        several = len({t.run.added_inertia_kg_m2 for t in (*fitting, *judging)}) > 1
        self.allowed = [
            n for n in allowed
            if effects.get(n).place is not Place.SENSOR and (several or not effects.get(n).needs_added_inertia)
        ]  # fmt: skip
        self.noise = float(np.sqrt(np.mean([t.noise**2 for t in fitting])))
        self.torque_free = all(t.torque is None for t in fitting)
        self.runs = 1 + max(t.number for t in (*fitting, *judging))
        self.so_far: Search | None = None  # for whoever is stopped in the middle

    def run(
        self, declared: Structure, shapes: Shapes, nominal: tuple[float, float, float] | None = None,
        take_over: Callable[[Search], bool] = lambda found: False,
    ) -> Search:  # fmt: skip
        """From the declared structure, with its declared shapes, to the one that the data support.

        ``nominal`` are declared J, C, K: a second place to begin from, for data that hardly tell J from K.
        ``take_over`` is asked before every round whether it goes on alone from what is found so far.
        """
        solution = best_rho(self.fitting, declared, shapes, self.start)
        horizon = horizon_s(solution.platform, self.fitting)
        length = horizon / self.fitting[0].step_s
        floor = self.noise * float(np.sqrt(max(1.0 - 2.0 / length, 0.25)))
        base = judge(self.fitting, self.judging, declared, start_values(solution, shapes, self.runs), horizon)
        doubtful = base.sigma > BEGIN_AGAIN * floor or _far_off(solution.platform, nominal)
        if nominal is not None and not self.torque_free and doubtful:
            start = start_values(replace(solution, platform=nominal), shapes, self.runs)
            other = judge(self.fitting, self.judging, declared, start, horizon)
            base = min((base, other), key=lambda j: j.estimate.sigma)
        found = self.so_far = Search(base, base, horizon, floor)
        self._probation(found, solution)
        for round_ in range(1, MOST_EFFECTS + 1):
            if take_over(found):
                return found
            if not self._round(found, round_):
                break
            self._prune(found, found.best.structure.effects[:-1])
        self._restore(found, declared)
        self._prune(found, (*found.best.structure.terms, *found.best.structure.effects))
        return found

    def _round(self, found: Search, round_: int) -> bool:
        """One more effect, if one is worth it."""
        now = found.best
        screen = self._screen(found, now)
        names = [n for n in self.allowed if n not in now.structure.effects and not why_unseen(n, self.fitting)]
        looks = screen.all(names)
        tried: list[tuple[str, Judged]] = []
        short = screen.shortlist(looks, SHORTLIST)
        # A delay lies in every record of torque and rate, and a microsecond of it bends C: tried always.
        always = {"torque_delay", *(low for s in short for low in effects.get(s.effect).lower_order)}
        if any(effects.get(e).place is Place.FRICTION for e in now.structure.effects):
            # Where dry friction holds the platform a regression along the measured rate cannot tell one from another.
            always |= {n for n in names if effects.get(n).place is Place.FRICTION}
        short += [s for s in looks if s.effect in always and s.gain > 10.0 and s not in short]
        for look in short:
            best_yet = min((j.estimate.sigma for _, j in tried), default=now.estimate.sigma)
            result = self._try(found, screen, look, HOPELESS * best_yet)
            tried += [result] if result else []
        tried.sort(key=lambda t: t[1].sigma)
        tried = self._again(found, screen, tried)
        if not tried:
            return False
        far = self._far(found, tried)
        name, best = self._simplest(tried, far, found, now)
        added = self._worth_adding(now, name, best, found.floor)

        def status_of(other: str, judged: Judged) -> str:
            if other == name:
                return "added" if added else "not worth it"
            if name in far:
                return self._status(far[name], far[other]) if other in far else "no better"
            return self._status(best, judged)

        for other, judged in tried:
            status = status_of(other, judged)
            found.candidates.append(Candidate(other, round_, delta_bic(now, judged), judged.sigma, status))
        shown = {n for n, _ in tried}
        for look in looks:
            if look.effect not in shown:
                found.candidates.append(Candidate(look.effect, round_, -2.0 * look.gain, None, "screened out"))
        if not added:
            return False
        self.say(f"added {name}: held-out error {now.sigma:.3g} -> {best.sigma:.3g}")
        close = {o: j.estimate.platform() for o, j in tried if status_of(o, j) == "rival"}
        found.rivals[name], found.rival_models[name] = tuple(close), close
        if not best.estimate.converged:
            again = judge(self.fitting, self.judging, best.structure, best.values(), found.horizon, rough_start=False)
            best = again if again.estimate.sigma <= best.estimate.sigma else best
        found.best = best
        return True

    def _far(self, found: Search, tried: Sequence[tuple[str, Judged]]) -> dict[str, Judged]:
        """Candidates that reach the noise floor, judged over whole pieces: a longer look ahead parts them."""
        near = [(n, j) for n, j in tried if j.sigma < NEAR * found.floor]
        if len(near) < 2:
            return {}
        return {
            n: judge(self.fitting, self.judging, j.structure, j.values(), FAR * found.horizon, 15, rough_start=False)
            for n, j in near
        }

    def _again(self, found: Search, screen: Screen, tried: list[tuple[str, Judged]]) -> list[tuple[str, Judged]]:
        """The best candidates once more from other shapes, while they stay above the noise floor.

        A shape (the Stribeck speed above all) has false minima that no step out of one of them finds.
        """
        out = []
        for rank, (name, first) in enumerate(tried):
            best = first
            shapes = [p.name for p in effects.get(name).parameters if not p.linear]
            if rank < AGAIN and shapes:
                grid = grid_of(effects.get(name), screen.scale)
                for shape in grid[:: max(1, len(grid) // RESTARTS)]:
                    if best.sigma < NEAR * found.floor:
                        break
                    start = first.values()
                    start.update({(name, p): v for p, v in zip(shapes, shape, strict=True)})
                    other = judge(
                        self.fitting, self.judging, first.structure, start, found.horizon,
                        hopeless=HOPELESS * best.estimate.sigma,
                    )  # fmt: skip
                    best = min((best, other), key=lambda j: (j.estimate.sigma, j.sigma))
            out.append((name, best))
        return sorted(out, key=lambda t: t[1].sigma)

    def _screen(self, found: Search, now: Judged) -> Screen:
        """Candidates are screened on the residual of the model as it stands.

        Near the noise floor its effects are taken off the torque along its own motion: the regression is
        then as good as the model, and what no candidate can gain there need not be simulated.
        """
        if now.structure.effects and now.sigma < NEAR * found.floor:
            bare = [
                effect_free(t, s, now.estimate)
                for t, s, r in zip(self.fitting, now.estimate.shots, now.estimate.residuals(), strict=True)
                if float(np.sqrt(np.mean(r[s.weight] ** 2))) < 2.0 * NEAR * found.floor  # no shot went astray
            ]
            if bare:
                return Screen(bare, Structure(now.structure.terms), {}, self.start, self._lines(now))
        return Screen(self.fitting, now.structure, now.shapes(), self.start, self._lines(now))

    def _try(self, found: Search, screen: Screen, look: Screened, hopeless: float) -> tuple[str, Judged] | None:
        structure = found.best.structure.plus(look.effect)
        start = {**found.best.values(), **start_values(screen.solution(look), look.shapes, self.runs)}
        judged = judge(self.fitting, self.judging, structure, start, found.horizon, hopeless=hopeless)
        if judged.estimate.sigma > found.best.estimate.sigma:  # nested: a worse fit is a lost search
            values = found.best.values()
            again = {n: values.get(n, v) for n, v in start.items()}
            other = judge(self.fitting, self.judging, structure, again, found.horizon, hopeless=hopeless)
            judged = min((judged, other), key=lambda j: j.sigma)
        return (look.effect, judged) if np.isfinite(judged.sigma) else None

    def _probation(self, found: Search, solution: Solution) -> None:
        """Set a spring aside that pushes, or whose period is longer than the record.

        On a platform without a spring, K soaks up whatever is constant or drifts (a constant torque, a
        slope of the friction) and hides it. It comes back at the end if the finished model misses it.
        """
        inertia, _, stiffness = solution.platform
        longest = max(t.offset_s + t.step_s * len(t.measured) for t in self.fitting)
        slow = stiffness > 0.0 and 2.0 * np.pi * np.sqrt(inertia / stiffness) > longest
        if "stiffness" not in found.best.structure.terms or not (stiffness <= 0.0 or slow):
            return
        values = {n: v for n, v in found.best.values().items() if n != ("stiffness",)}
        found.best = judge(self.fitting, self.judging, found.best.structure.minus("stiffness"), values, found.horizon)
        why = (
            "it came out negative"
            if stiffness <= 0.0
            else f"its period would be longer than the {longest:.3g} s record"
        )
        found.dropped.append(("stiffness", f"{why}, and the final model predicts as well without it"))

    def _worth_adding(self, now: Judged, name: str, new: Judged, floor: float) -> bool:
        """Whether an effect lowers the held-out error clearly, by enough, and with parameters that stand out."""
        share, lead = share_explained(now, new, floor), advantage(now, new)
        # A few long shots cannot reach a high t value however well the effect explains them.
        clear = lead > CLEARLY or (share > MOST and lead > 1.0)
        return clear and share >= WORTH and delta_bic(now, new) < -10.0 and new.strength(name) > STRONG

    def _simplest(
        self, tried: Sequence[tuple[str, Judged]], far: dict[str, Judged], found: Search, now: Judged
    ) -> tuple[str, Judged]:
        """The best candidate, or the one with the fewest parameters that does as well.

        Far above the noise floor, where no candidate is the whole truth, a special case of the best one
        does as well when it leaves at most twice the excess; and what comes first by marginality goes first.
        """
        tried = [t for t in tried if t[1].strength(t[0]) > STRONG] or list(tried)
        if far:
            short = dict(tried)
            order = sorted((n for n in far if n in short), key=lambda n: far[n].sigma)
            if order:
                alike = [n for n in order if n == order[0] or self._status(far[order[0]], far[n]) == "rival"]
                chosen = min(alike, key=lambda n: (simplicity(n), len(effects.get(n).parameters), far[n].sigma))
                return chosen, short[chosen]
        name, best = tried[0]
        as_good = [t for t in tried if t[1] is best or self._status(best, t[1]) == "rival"]
        excess = best.sigma**2 - found.floor**2
        if best.sigma > 1.5 * found.floor:
            nested = effects.get(name).nests
            as_good += [
                t for t in tried
                if t[0] in nested and t not in as_good and t[1].sigma**2 - found.floor**2 < TWICE * excess
            ]  # fmt: skip
        name, best = min(as_good, key=lambda t: (simplicity(t[0]), len(effects.get(t[0]).parameters), t[1].sigma))
        for other, judged in tried:
            if other in effects.get(name).lower_order and self._worth_adding(now, other, judged, found.floor):
                return other, judged
        return name, best

    def _status(self, best: Judged, other: Judged) -> str:
        return "rival" if advantage(other, best) < CLEARLY and other.sigma < 1.05 * best.sigma else "no better"

    def _lines(self, judged: Judged) -> tuple[float, ...]:
        """Frequencies of the strongest lines in the equation-error residual."""
        from identify.diagnose.torque_residual import residual_lines_hz  # noqa: PLC0415  (residual imports the search's parts)

        return residual_lines_hz(self.whole, judged)

    def _prune(self, found: Search, names: Sequence[str]) -> None:
        """Drop every term or effect that the model does as well without."""
        for name in names:
            now = found.best
            kept_by = [e for e in now.structure.effects if name in effects.get(e).lower_order]
            last = len(now.structure.terms) - (1 if self.torque_free else 0) + len(now.structure.effects) <= 1
            if name == "inertia" or kept_by or last:
                continue
            if now.strength(name) > CERTAIN:
                continue
            smaller = now.structure.minus(name)
            values = now.values()
            start = {n: v for n, v in values.items() if n[0] != name}
            without = judge(self.fitting, self.judging, smaller, start, found.horizon)
            if self._missed(without, now, found.floor):
                continue
            reason = f"held-out error {now.sigma:.4g} with it, {without.sigma:.4g} without it"
            found.dropped.append((name, reason))
            found.best = without
            found.rivals.pop(name, None)
            self.say(f"dropped {name}: {reason}")

    def _restore(self, found: Search, declared: Structure) -> None:
        """Take a declared term back that is missed now that the effects are there."""
        for name in declared.terms:
            if name in found.best.structure.terms:
                continue
            now = found.best
            structure = replace(now.structure, terms=tuple(t for t in TERMS if t in (*now.structure.terms, name)))
            with_it = judge(self.fitting, self.judging, structure, {**now.values(), (name,): 0.0}, found.horizon)
            missed = share_explained(now, with_it, found.floor) > WORTH and advantage(now, with_it) > 1.0
            if missed and with_it.strength(name) > STRONG:
                found.best = with_it
                found.dropped = [d for d in found.dropped if d[0] != name]
                self.say(f"restored {name}: held-out error {now.sigma:.4g} -> {with_it.sigma:.4g}")

    def _missed(self, without: Judged, full: Judged, floor: float) -> bool:
        """Whether leaving a term out costs a clear part of the accuracy."""
        loss = (without.sigma**2 - full.sigma**2) / max(full.sigma**2, 1e-300)
        near_floor = full.sigma < 1.2 * floor
        needed = 1e-4 if near_floor else SUPPORT
        return loss > MISSED or (advantage(without, full) > CLEARLY and loss > needed)
