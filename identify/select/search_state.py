"""What a search over structures has found so far, and what of it is believed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from identify.model.parameter_fit import ParameterFit, reduced_chi_square
from identify.model.parameters import Name
from identify.results import Candidate
from rig.arrays import Array
from rig.platform import TERMS, Platform


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

    def drop(self, without: ParameterFit, status: str = "added, then no longer needed") -> None:
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
