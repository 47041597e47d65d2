"""What a search over structures has found so far, and what of it is believed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from identify.estimate.judged import Judged, share_explained
from identify.results import Candidate
from rig.platform import Platform


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
    dropped
        Terms of the declared model and effects that the data do not support, with the reason.
    free_running
        Whether ``best`` was judged over whole runs, by a search that believed it there.
    contribution
        Effect -> held-out error without it over the one with it, once the search is through.
    left_open, tells_apart
        In words, an effect that was found and may be something else as well, and what would tell which.
    """

    base: Judged
    best: Judged
    horizon: float
    floor: float
    candidates: list[Candidate] = field(default_factory=list)
    rivals: dict[str, tuple[str, ...]] = field(default_factory=dict)
    rival_models: dict[str, dict[str, Platform]] = field(default_factory=dict)
    dropped: list[tuple[str, str]] = field(default_factory=list)
    free_running: bool = False
    contribution: dict[str, float] = field(default_factory=dict)
    left_open: str = ""
    tells_apart: str = ""

    @property
    def share(self) -> float:
        """Share of the excess over the noise floor that the effects found take away, held-out squares."""
        return share_explained(self.base, self.best, self.floor)

    def take_all_back(self) -> None:
        """Name nothing: the declared model is what there is."""
        kept = self.base.structure.effects
        self.candidates = [
            replace(c, status="rejected with the others") if c.status == "added" and c.effect not in kept else c
            for c in self.candidates
        ]  # fmt: skip
        self.best, self.rivals, self.rival_models, self.dropped = self.base, {}, {}, []
        self.free_running = False

    def leave_open(self, name: str, told: tuple[str, str], without: Judged) -> None:
        """Take an effect back that may as well be something no library has, and what was found beside it.

        ``without`` is the model of what was found before it.
        """
        gone = [e for e in self.best.structure.effects if e not in without.structure.effects]
        status = {e: "left open" if e == name else "found together with an open effect" for e in gone}
        self.candidates = [
            replace(c, status=status[c.effect]) if c.status == "added" and c.effect in status else c
            for c in self.candidates
        ]  # fmt: skip
        for effect in gone:
            self.rivals.pop(effect, None)
            self.rival_models.pop(effect, None)
        self.best, self.dropped, self.free_running = without, [], False
        self.left_open, self.tells_apart = told
