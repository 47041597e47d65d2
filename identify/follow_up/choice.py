"""Which of the possible sets part all pairs of models in the shortest time.

A short list is drawn up by how far apart both models run and scored to first order. The best are put to the proof.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from identify.follow_up.excitations import Candidate
from identify.follow_up.pairs import Pair
from identify.follow_up.separation import Imitation, Sensor, Share, measured, settled, share_of, shots_of
from rig.excitation import PlannedSet
from rig.platform import Platform

MIN_CHI_SQUARE = 25.0  # chi square that a plan has to promise: five standard errors
GOOD = 400.0  # from which more sets are not worth their time
BEST = 1e4  # from which more of it proves nothing more
EQUIVALENT_SCORE_RATIO = 0.5  # of the best score: the shorter of two such sets is played
MAX_PLANNED_SETS = 4  # of a plan
PROOFS = 3  # sets that are put to the proof in a round
PARALLEL_PROOFS = 2  # of them: the compiled simulations run side by side
MAX_CANDIDATES_OF_PAIR = 14  # candidates of a pair whose sensitivities are taken


class PairSeparations:
    """Chi square between the models of each pair under each candidate, computed where it is asked for."""

    def __init__(
        self, pairs: Sequence[Pair], choice: Sequence[Candidate], models: Sequence[Platform], sensor: Sensor,
        weight: float,
    ) -> None:  # fmt: skip
        self.pairs, self.choice, self._sensor, self._weight = pairs, choice, sensor, weight
        self._models = models
        self._checked: dict[tuple[int, ...], float] = {}  # by the identity of what is kept here anyway
        self._shares: dict[tuple[int, int, int], Share] = {}
        self.shortlist = sorted({i for p in pairs for i in self._promising(p)})

    def _promising(self, pair: Pair) -> list[int]:
        """The candidates with the largest difference of each amplitude: a small one may tell more in the end."""
        one, other = (self._models.index(m) for m in pair.models)
        scale = self._weight / self._sensor.noise**2
        size = [scale * float(np.sum((c.seen[one] - c.seen[other]) ** 2)) for c in self.choice]
        shares = sorted({c.share for c in self.choice}, reverse=True)
        per = max(1, MAX_CANDIDATES_OF_PAIR // len(shares))
        out = []
        for share in shares:
            mine = [i for i, c in enumerate(self.choice) if c.share == share and size[i] > MIN_CHI_SQUARE]
            out += sorted(mine, key=lambda i: -size[i])[:per]
        return out

    def _share(self, i: int, k: int, w: int, imitation: Imitation) -> Share:
        key = (i, k, w)
        if key not in self._shares:
            trace = measured(imitation.truth, self.choice[i].planned, self._sensor)
            found = share_of(imitation.model, shots_of(imitation.model, trace))
            g = self._weight
            self._shares[key] = Share(g * found.squares, g * found.gradient, g * found.information)
        return self._shares[key]

    def separation(self, chosen: Sequence[int], k: int) -> float:
        """Chi square between the models of pair ``k`` after all chosen sets, in the worse direction."""
        left = []
        for w, imitation in enumerate(self.pairs[k].imitations):
            several = [self._share(i, k, w, imitation) for i in chosen]
            total = several[0]
            for one in several[1:]:
                total = total + one
            left.append(total.left(imitation.prior))
        return min(left)

    def score(self, chosen: Sequence[int]) -> float:
        """How well all pairs are parted to first order: more of what is enough counts nothing."""
        return _worth(self.separation(chosen, k) for k in range(len(self.pairs)))

    def checked(self, sets: Sequence[Candidate], pair: Pair) -> float:
        """Chi square between the models of a pair after all sets, the loser fitted along the bend."""
        plans = [s.planned for s in sets]
        key = (*(id(p) for p in plans), id(pair))
        if key not in self._checked:
            self._checked[key] = self._settled(plans, pair)
        return self._checked[key]

    def _settled(self, plans: Sequence[PlannedSet], pair: Pair) -> float:
        """In the worse of both directions; too little in one is too little."""
        least = np.inf
        for imitation in pair.imitations:
            least = min(least, settled(imitation, plans, self._sensor, self._weight, MIN_CHI_SQUARE))
            if least < MIN_CHI_SQUARE:
                break
        return float(least)

    def proved(self, chosen: Sequence[int], before: Sequence[float] | None = None) -> list[float]:
        """The same for every pair; of pairs that fewer sets part well enough ``before``, what these promised."""
        sets = [self.choice[i] for i in chosen]
        known = before or [0.0] * len(self.pairs)
        return [b if b >= GOOD else self.checked(sets, pair) for pair, b in zip(self.pairs, known, strict=True)]

    def duration(self, i: int) -> float:
        """Length of a candidate in seconds."""
        return self.choice[i].planned.duration_s


def _worth(separations: Iterable[float]) -> float:
    return float(sum(np.log1p(np.clip(x, 0.0, BEST)) for x in separations))


def choose(separations: PairSeparations) -> list[int]:
    """Set by set, each the one that parts most; the shortest of those that do nearly as well.

    What looks best to first order is put to the proof, one after the other, until one stands.
    """
    chosen: list[int] = []
    reached, stands = 0.0, [0.0] * len(separations.pairs)
    while separations.shortlist and len(chosen) < MAX_PLANNED_SETS:
        gains = {i: separations.score([*chosen, i]) for i in separations.shortlist}
        best = max(gains.values())
        alike = sorted(
            (i for i, g in gains.items() if g > best - EQUIVALENT_SCORE_RATIO),
            key=lambda i: (separations.duration(i), -separations.choice[i].share),
        )
        others = sorted((i for i in gains if i not in alike), key=lambda i: -gains[i])
        order = _varied(separations, [*alike, *others])
        proofs = _proofs(separations, chosen, order[:PROOFS], stands)
        winner = max(proofs, key=lambda i: _worth(proofs[i]))
        if chosen and _worth(proofs[winner]) < reached + 0.1:  # of the logarithm: nothing that would be seen
            break
        chosen.append(winner)
        stands = proofs[winner]
        reached = _worth(stands)
        if min(stands) >= GOOD:
            break
    return chosen


def _proofs(
    separations: PairSeparations, chosen: Sequence[int], several: Sequence[int], stands: Sequence[float]
) -> dict[int, list[float]]:
    """Chi square of every pair with each of several sets added, two at a time until one parts all of them well."""

    def proof(i: int) -> list[float]:
        with np.errstate(all="ignore"):  # which a thread does not inherit
            return separations.proved([*chosen, i], stands)

    found: dict[int, list[float]] = {}
    with ThreadPoolExecutor(PARALLEL_PROOFS) as workers:
        for begin in range(0, len(several), PARALLEL_PROOFS):
            some = several[begin : begin + PARALLEL_PROOFS]
            found |= zip(some, workers.map(proof, some), strict=True)
            if any(min(found[i]) >= GOOD for i in some):
                break
    return found


def _varied(separations: PairSeparations, order: Sequence[int]) -> list[int]:
    """The same order, but the best of every amplitude first: where one amplitude misleads, the next is another."""
    first: list[int] = []
    for i in order:
        if separations.choice[i].share not in {separations.choice[k].share for k in first}:
            first.append(i)
    return [*first, *(i for i in order if i not in first)]
