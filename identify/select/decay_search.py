"""A free decay, asked once more over whole runs: without torque a run strays by the model's own error alone.

Over a short horizon gravity and a softening spring, or drag and viscous damping, hardly differ; over a decay from
large swings to small ones they do. The sensor's noise is far below what such a model leaves, so that chi square says
nothing: an effect has to take a clear part of the squares, of the samples fitted and of the held-out ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from identify.model.parameters import Name
from identify.results import Candidate
from identify.select.candidates import Candidates
from identify.select.criterion import STILL_FAR, STRONG
from identify.select.free_run_fit import TWICE, Whole
from identify.select.search_state import MOST_NAMED, Search
from rig import effects
from rig.effects.base import Place
from rig.platform import Platform
from rig.recording.run import Array, Run

A_PERIOD = 100  # samples that show everything a slow swing does
PLENTY = 15_000  # samples a search needs
SHORTEST = 200  # samples that the shortest run keeps
LEFT = 0.6  # of the squares, at most, that an effect leaves which is worth its name
ALIKE = 1.2  # times the squares of the best: the simpler of two does as well
NEEDLESS = 1.05  # times the squares without a term that nothing asks for
PUSHES = 2.0  # the same where the term has the sign that no spring and no damper has
STILL_COARSE = 10.0  # times the sensor's noise
MUCH_BETTER = 0.5  # of the held-out squares: what was found over a short horizon goes


def thinned(runs: Sequence[Run], natural_hz: float) -> list[Run]:
    """Every so manyth sample of runs without torque, where a period has far more than show anything."""
    count = sum(len(r.time_s) for r in runs)
    step_s = float(np.median(np.diff(runs[0].time_s)))
    shortest = min(len(r.time_s) for r in runs)
    every = int(min(1.0 / max(A_PERIOD * natural_hz * step_s, 1e-12), count / PLENTY, shortest / SHORTEST))
    return [_every(r, every) for r in runs] if every > 1 else list(runs)


def _every(run: Run, step: int) -> Run:
    def cut(values: Array | None) -> Array | None:
        return None if values is None else values[::step]

    return replace(
        run, time_s=run.time_s[::step], valid=run.valid[::step], rate_rad_s=cut(run.rate_rad_s),
        angle_rad=cut(run.angle_rad), channels={k: v[::step] for k, v in run.channels.items()},
    )  # fmt: skip


def take_over(offer: Candidates, found: Search, say: Callable[[str], None]) -> bool:
    """Go on over whole runs, once a short horizon has found the first effect; ``found`` is brought up to date.

    False, and nothing changed, where that does not bring the model closer by half.
    """
    if found.best.structure == found.base.structure:
        return False
    base = offer.fits.whole(found.base.structure, found.base.values())
    now = offer.fits.whole(found.best.structure, found.best.values())
    if base is None or now is None or now.level < STILL_FAR:
        return False
    offer.fits.horizon = found.horizon
    decay = _Decay(offer, found, say)
    at_first, now = now, decay.asked_again(now)
    while len(now.structure.effects) < len(base.structure.effects) + MOST_NAMED:
        further = decay.round(now)
        if further is None:
            break
        now = decay.asked_again(further)
    if now.held > MUCH_BETTER * at_first.held:
        return False
    decay.write(base, now)
    return True


class _Decay:
    def __init__(self, offer: Candidates, found: Search, say: Callable[[str], None]) -> None:
        self.offer, self.found, self.say = offer, found, say
        self.rivals: dict[str, dict[str, dict[Name, float]]] = {
            name: {r: _own(r, platform) for r, platform in models.items()}
            for name, models in found.rival_models.items()
        }  # fmt: skip
        self.alike: dict[str, dict[str, Whole]] = {}
        self.candidates: list[Candidate] = []

    def round(self, now: Whole) -> Whole | None:
        """With one more effect; None where none takes enough."""
        tried, _ = self.offer.tried(now, in_full=True)
        tried |= self._plain_ones(now, tried)
        bare = {n: self._bare(w) for n, w in tried.items()}
        good = {n: w for n, w in bare.items() if self._worth(n, w, now)}
        name = _chosen(good)
        number = 1 + max((c.round for c in (*self.found.candidates, *self.candidates)), default=0)
        for other, w in bare.items():
            held = float(np.sqrt(w.held / max(w.held_count, 1))) * self.offer.fits.noise
            status = "added" if other == name else "no better" if name else "not worth it"
            self.candidates.append(Candidate(other, number, w.penalised - now.penalised, held, status))
        if name is None:
            return None
        self.say(f"added {name}: free-run error {now.estimate.sigma:.3g} -> {good[name].estimate.sigma:.3g}")
        self._note(name, good)
        self.rivals[name] = {
            n: {k: v for k, v in w.values().items() if k[0] in (n, "stiffness")} for n, w in good.items() if n != name
        }  # fmt: skip
        return good[name]

    def _plain_ones(self, now: Whole, tried: Mapping[str, Whole]) -> dict[str, Whole]:
        """All effects that are nothing but gains, fitted from nothing: a score far from the data points anywhere."""
        out = {}
        for name in self.offer.allowed:
            effect = effects.get(name)
            plain = effect.place in (Place.LOAD, Place.FRICTION) and all(p.linear for p in effect.parameters)
            if name in tried or name in now.structure.effects or not plain or effect.reads:
                continue
            nothing: dict[Name, float] = {(name, p.name): 0.0 for p in effect.parameters}
            start = {**now.values(), **nothing}
            fitted = self.offer.fits.by_way_of_a_short_horizon(now.structure.plus(name), start)
            if fitted is not None:
                out[name] = fitted
        return out

    def _worth(self, name: str, new: Whole, now: Whole) -> bool:
        clear = new.squares < LEFT * now.squares and new.held < LEFT * now.held
        return clear and new.judged().strength(name) > STRONG

    def asked_again(self, now: Whole) -> Whole:
        """Every effect against those that came near it, in the model as it stands now."""
        now = self._bare(now)
        for name in now.structure.effects:
            tried = {name: now}
            for rival, own in self.rivals.get(name, {}).items():
                if rival in now.structure.effects:
                    continue
                start = {n: v for n, v in now.values().items() if n[0] != name} | own
                names = tuple(rival if e == name else e for e in now.structure.effects)
                terms = self.found.base.structure.terms  # a rival may need a spring that the other made needless
                start |= {(t,): 0.0 for t in terms if (t,) not in start}
                swapped = self.offer.fits.by_way_of_a_short_horizon(
                    replace(now.structure, terms=terms, effects=names), start
                )
                if swapped is not None:
                    tried[rival] = self._bare(swapped)
            chosen = _chosen(tried) or name
            if chosen != name:
                self.say(f"replaced {name} by {chosen}: it fits better beside the other effects")
                mine = {n: v for n, v in now.values().items() if n[0] in (name, "stiffness")}
                self.rivals[chosen] = {**self.rivals.pop(name, {}), name: mine}
            self._note(chosen, tried)
            now = tried[chosen]
        return now

    def _bare(self, now: Whole) -> Whole:
        """Without damping or stiffness that nothing asks for, or that push."""
        for term in ("stiffness", "damping"):
            if term not in now.structure.terms or len(now.structure.terms) + len(now.structure.effects) < 3:
                continue
            allowance = PUSHES if now.values()[(term,)] <= 0.0 else NEEDLESS
            start = {n: v for n, v in now.values().items() if n != (term,)}
            without = self.offer.fits.whole(now.structure.minus(term), start)
            if without is not None and without.squares < allowance * now.squares:
                now = without
        return now

    def _note(self, name: str, tried: Mapping[str, Whole]) -> None:
        """Who does as well as the one chosen."""
        self.alike[name] = {n: w for n, w in tried.items() if n != name and w.squares < ALIKE * tried[name].squares}

    def write(self, base: Whole, now: Whole) -> None:
        """What came of it, into the search's books."""
        found, named = self.found, now.structure.effects
        for c in found.candidates:
            gone = c.status == "added" and c.effect not in named
            self.candidates.append(replace(c, status="no better, now that others are there") if gone else c)
        found.candidates = sorted(self.candidates, key=lambda c: c.round)
        found.base, found.best, found.floor = base.judged(), now.judged(), self.offer.fits.noise
        found.rivals = {n: tuple(self.alike.get(n, {})) for n in named}
        found.rival_models = {n: {r: w.estimate.platform() for r, w in self.alike.get(n, {}).items()} for n in named}
        found.dropped = [
            (t, "the free-run error is as small without it")
            for t in found.base.structure.terms if t not in now.structure.terms
        ]  # fmt: skip


def _chosen(tried: Mapping[str, Whole]) -> str | None:
    """The closest, or the simplest of those that are as close."""
    if not tried:
        return None
    # What can follow anything is believed only where it brings the model down to the noise.
    tried = {n: w for n, w in tried.items() if w.at_noise or not effects.get(n).resembles_much} or tried
    best = min(tried, key=lambda n: tried[n].squares)
    alike = [n for n, w in tried.items() if w.squares < ALIKE * tried[best].squares]
    # The richer one may only soak up what is still missing.
    nested = [n for n in effects.get(best).nests if n in tried and tried[n].squares < TWICE * tried[best].squares]
    return min(nested or alike, key=lambda n: (len(tried[n].estimate.names), tried[n].squares))


def _own(name: str, platform: Platform) -> dict[Name, float]:
    """Where a rival begins: its own parameters, and the spring that it leaves."""
    return {("stiffness",): platform.stiffness_nm_rad, **{(name, p): v for p, v in platform.effects[name].items()}}
