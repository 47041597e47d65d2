"""What a search over structures has found so far, and what of it is believed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identify.diagnose.torque_fit import TorqueErrors
from identify.estimate.final_fit import FinalFit
from identify.likelihood.fit import Fit
from identify.model.parameter_fit import ParameterFit, reduced_chi_square
from identify.model.parameters import Name
from identify.results import TAKEN_BACK, Candidate, Dependence, Disturbance
from identify.select.disturbance_lines import lines_left
from rig import effects
from rig.arrays import Array
from rig.platform import TERMS, Platform

ANOTHER = 0.5  # of the inertia, by which the likeliest platform is another than the one that is reported


@dataclass
class Search:
    """What the loop found.

    Attributes
    ----------
    base
        The declared model; ``best`` the model at the end.
    rivals
        Effect -> other effects that did as well in its round.
    rival_models
        Effect -> rival -> the platform fitted with the rival in its place.
    between_rivals
        Effect -> variance of J, C and K over it and the rivals in its place, (3,).
    dropped
        Terms of the declared model and effects that the data do not support, with the reason.
    contribution
        Effect -> held-out error without it over the one with it, once the search is through.
    left_open, tells_apart
        In words, an effect that was found and may be something else as well, and what would tell which.
    """

    base: ParameterFit
    best: ParameterFit
    horizon: float
    floor: float
    candidates: list[Candidate] = field(default_factory=list)
    rivals: dict[str, tuple[str, ...]] = field(default_factory=dict)
    rival_models: dict[str, dict[str, Platform]] = field(default_factory=dict)
    between_rivals: dict[str, Array] = field(default_factory=dict)
    dropped: list[tuple[str, str]] = field(default_factory=list)
    contribution: dict[str, float] = field(default_factory=dict)
    left_open: str = ""
    tells_apart: str = ""

    def reduced_chi_square(self, fit: ParameterFit) -> float:
        """Of what one of its models leaves on samples held out."""
        return reduced_chi_square(fit.held_out_error, self.floor)

    @property
    def spread_between_rivals(self) -> dict[Name, float]:
        """Standard deviation of J, C and K over models that the data do not part."""
        variance = np.sum(list(self.between_rivals.values()), axis=0) if self.between_rivals else np.zeros(len(TERMS))
        return {(term,): float(np.sqrt(v)) for term, v in zip(TERMS, variance, strict=True)}

    def reject_all(self) -> None:
        """Name nothing: the declared model is what there is."""
        kept = self.base.structure.effects
        self.candidates = [
            replace(c, status="rejected with the others") if c.status == "added" and c.effect not in kept else c
            for c in self.candidates
        ]  # fmt: skip
        self.best, self.rivals, self.rival_models, self.dropped = self.base, {}, {}, []
        self.between_rivals = {}

    def add_found(self, other: Search, names: Sequence[str]) -> None:
        """Tell of effects what another search, which has found them, has to tell."""
        self.candidates += [c for c in other.candidates if c.effect in names]
        self.rivals |= {k: v for k, v in other.rivals.items() if k in names}
        self.rival_models |= {k: v for k, v in other.rival_models.items() if k in names}

    def drop(self, without: ParameterFit, status: str = TAKEN_BACK) -> None:
        """Take back the effects that the final model does without; the report gives them this status."""
        self._take_back(without, lambda effect: status)

    def mark_undetermined(self, name: str, sentences: tuple[str, str], without: ParameterFit) -> None:
        """Take an effect back that may as well be something no library has, and what was found beside it.

        ``without`` is the model of what was found before it.
        """
        self._take_back(without, lambda effect: "left open" if effect == name else "found together with an open effect")
        self.dropped = []
        self.left_open, self.tells_apart = sentences

    def _take_back(self, without: ParameterFit, status_of: Callable[[str], str]) -> None:
        gone = [e for e in self.best.structure.effects if e not in without.structure.effects]
        self.candidates = [
            replace(c, status=status_of(c.effect)) if c.status == "added" and c.effect in gone else c
            for c in self.candidates
        ]  # fmt: skip
        for effect in gone:
            self.rivals.pop(effect, None)
            self.rival_models.pop(effect, None)
            self.between_rivals.pop(effect, None)
        self.best = without


@dataclass(frozen=True)
class Found:
    """What the search found.

    Attributes
    ----------
    search
        Candidates, rivals and what was dropped, for the report.
    before, after
        The declared model and the final one, fitted.
    in_torque
        How far both are from the torque.
    disturbance
        What the final model leaves.
    lacking
        The final model without some effects.
    share_of
        What effects take of the torque's power on held-out samples, of the model without some, and beside the
        free-form term of a part of what is left.
    """

    search: Search
    before: FinalFit
    after: FinalFit
    disturbance: Disturbance
    in_torque: tuple[TorqueErrors, TorqueErrors]
    lacking: Callable[..., tuple[FinalFit, TorqueErrors, Disturbance]]
    share_of: Callable[..., float]
    taken_back: tuple[str, ...] = ()
    others: str | None = None  # what the rest depended on when others were put in the place of what was taken back

    def without(self, *several: str, others: str | None = None) -> Found:
        """The same with effects taken back; what was found beside them stays, fitted anew.

        With others in their place that carry weight without them, where a quantity is given that the rest depends on:
        such as go with that, or do not follow almost anything.
        """
        gone, others = (*self.taken_back, *several), self.others if others is None else others
        after, errors, disturbance = self.lacking(*gone, others=others)
        both = (self.in_torque[0], errors)
        return replace(self, taken_back=gone, others=others, after=after, in_torque=both, disturbance=disturbance)

    def taken_by(self, name: str, part: Dependence | None = None) -> float:
        """What effects of one kind take of the torque's power on held-out samples; infinite where no torque shows them.

        Beside the free-form term of a part of what is left, where one is given.
        """
        kind = [n for n in self.named if effects.first_of(n) == effects.first_of(name)]
        return self.share_of(kind, *self.taken_back, others=self.others, part=part)

    def with_lines(self, likeliest: Fit, torque_nm: float) -> Found:
        """The same with the spectral lines of what the likeliest model leaves, where that is the final one."""
        final = describes(likeliest, self.after) and not self.disturbance.depends_on
        lines = lines_left(likeliest, torque_nm) if final else None
        return self if lines is None else replace(self, disturbance=self.disturbance.with_free_form(lines, {}))

    @property
    def kept(self) -> ParameterFit:
        """The model that is believed, as the search tells it."""
        return self.after.fit if self.named else self.search.base

    @property
    def named(self) -> list[str]:
        """Effects that the declared model lacked."""
        return [e for e in self.after.structure.effects if e not in self.before.structure.effects]


def describes(likeliest: Fit, final: FinalFit) -> bool:
    """Whether what is left beside the likeliest model is left beside the final one, too."""
    ours, theirs = (f.values.get(("inertia",), 0.0) for f in (final, likeliest))
    same = abs(theirs - ours) <= ANOTHER * abs(ours)
    return same and set(final.structure.effects) <= set(likeliest.structure.effects)
