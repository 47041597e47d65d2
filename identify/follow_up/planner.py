"""The follow-up: for a name that has a rival, the excitation that parts the two best within the limits.

Every shape at every amplitude is simulated on both models; what the loser could still take up is projected off
(``separation``), and the sets that part all pairs in the shortest time make the plan. Nothing here plays.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from identify.bounds.achieved import usable_traces
from identify.follow_up.excitations import Candidate, candidates, fitting, shapes
from identify.follow_up.pairs import Pair, pairs_of
from identify.follow_up.separation import Sensor, Share, Way, coarser, measured, settled, share_of, shots_of
from identify.follow_up.wording import verdict_sentences, why_of
from identify.results import FollowUp, FollowUpPlan, Identification, Parting, Unparted
from identify.wording import number
from rig import effects
from rig.config.excitation import ExcitationConfig
from rig.excitation import PlannedSet
from rig.platform import Platform
from rig.preflight import Peaks
from rig.recording.run import Recording

MIN_CHI_SQUARE = 25.0  # chi square that a plan has to promise: five standard errors
GOOD = 400.0  # from which more sets are not worth their time
BEST = 1e4  # from which more of it proves nothing more
EQUIVALENT_SCORE_RATIO = 0.5  # of the best score: the shorter of two such sets is played
MAX_SETS = 4
FAINT = 0.005  # of the largest torque played so far: drives take torque in steps of about a thousandth
PROOFS = 3  # sets that are put to the proof in a round
LOOKED_AT = 14  # candidates of a pair whose sensitivities are taken
LOOKS = 30.0  # samples a period of the platform's own oscillation: no shape goes beyond three times its frequency
USUAL_HZ = 5.0  # where nothing swings
MIN_DAMPING_SHARE = 0.05  # of the identified one, where the runs hardly tell it
IN_DOUBT = 3.0  # times its interval
WELL_KNOWN = 0.8  # of it, that far below
CAP = 1.3  # times the predicted travel: what a set may reach on a rig whose declared model is another one


@dataclass(frozen=True)
class Table:
    """What the rig allows, and how a set is read."""

    allowed: Peaks
    sensor: Sensor
    rest_s: float
    prefix: str = "follow-up"
    linear: bool = False
    least_torque_nm: float = 0.0  # what a drive still makes well


def plan_follow_up(
    found: Identification, recording: Recording, allowed: Peaks, sample_rate_hz: float, rest_s: float,
    prefix: str = "follow-up",
) -> FollowUp | None:  # fmt: skip
    """What to play next so that no name has a rival; None where none has one.

    Parameters
    ----------
    recording
        What ``found`` was identified from: its information stays, and is added to.
    allowed
        Travel in degrees, rate in degrees per second and torque in N m that no set may exceed (on a linear axis a
        metre counts as a radian).
    sample_rate_hz
        Of the sets to come.
    prefix
        What the names of the sets begin with; names of one campaign have to differ.
    """
    if not any(found.verdict.confusable_with.values()):
        return None
    if any(run.torque_nm is None or not np.any(run.torque_nm) for run in recording.runs):
        why = "without a recorded torque no excitation can be planned: record a decay from another amplitude"
        return FollowUp(None, tuple(Unparted(e, r, why) for e, rivals in _all(found) for r in rivals))
    traces = usable_traces(recording)
    if not traces:
        return None
    noise = max(found.noise_floor.holdout_rate_rms, found.final.error.holdout_rate_rms or 0.0)
    with np.errstate(all="ignore"), threadpool_limits(1):  # small matrices: a second BLAS thread only waits
        pairs, without = pairs_of(found, traces, noise, allowed.travel_deg)
        if not pairs:
            return FollowUp(None, tuple(without))
        sensor = Sensor(sample_rate_hz, noise, traces[0].channel)
        played = max(float(np.max(np.abs(r.torque_nm))) for r in recording.runs if r.torque_nm is not None)
        table = Table(allowed, sensor, rest_s, prefix, found.axis == "linear", FAINT * played)
        return _planned(pairs, without, table, _least_damping(found))


def _all(found: Identification) -> list[tuple[str, tuple[str, ...]]]:
    return list(found.verdict.confusable_with.items())


def _least_damping(found: Identification) -> float:
    """The least share of the identified damping to reckon with: near a resonance that is what limits.

    Three times as far below as its interval reaches: a follow-up is planned because the model is in doubt, and with the
    wrong one of two rivals the interval holds for the wrong damping.
    """
    damping = found.final.parameters.get("damping")
    if damping is None or not damping.value > 0.0:
        return MIN_DAMPING_SHARE
    below = IN_DOUBT * (damping.value - damping.ci95[0]) / damping.value
    return float(np.clip(1.0 - below, MIN_DAMPING_SHARE, 1.0))


def _planned(pairs: Sequence[Pair], without: list[Unparted], table: Table, least_damping: float) -> FollowUp:
    models: list[Platform] = []
    models += [m for p in pairs for m in p.models if m not in models]
    lighter = [replace(m, damping_nm_s_rad=least_damping * m.damping_nm_s_rad) for m in models]
    bearing = [*models, *(lighter if least_damping < WELL_KNOWN else [])]
    own_hz = natural_hz(models[0])
    look, weight = coarser(table.sensor, LOOKS * own_hz)
    several = shapes(own_hz, table.sensor.sample_rate_hz)
    choice = candidates(several, bearing, table.allowed, look, table.least_torque_nm)
    if not choice:
        why = f"no kind of excitation stays within the limits at {number(table.least_torque_nm, 2)} N m or more"
        return FollowUp(None, (*without, *(Unparted(p.effect, p.rival, why) for p in pairs)))
    looks = _Looks(pairs, choice, models, look, weight)
    sets = [s for i in _choose(looks) if (s := fitting(choice[i], bearing, table.allowed)) is not None]
    partings, failed = [], list(without)
    for pair in pairs:
        best = looks.checked(sets, pair) if sets else 0.0
        if best >= MIN_CHI_SQUARE:
            partings.append(Parting(pair.effect, pair.rival, best))
        else:
            failed.append(Unparted(pair.effect, pair.rival, _too_little(pair, best)))
    if not partings:
        return FollowUp(None, tuple(failed))
    plan = FollowUpPlan(
        _section(sets, table), tuple(partings), sum(c.planned.duration_s for c in sets), why_of(partings, sets)
    )
    return FollowUp(plan, tuple(failed))


def _too_little(pair: Pair, reached: float) -> str:
    """Why a pair has no part in the plan."""
    cure = effects.get(pair.effect).separated_by
    told = f" (to distinguish it {cure})" if cure.startswith("from ") else ""
    return (
        f"no excitation within the limits separates them: the best reaches a chi-square of {number(reached, 2)}, "
        f"{MIN_CHI_SQUARE:g} is needed{told}"
    )


def natural_hz(platform: Platform) -> float:
    """The frequency that a platform swings at, or a usual one where it has no spring."""
    j, k = platform.inertia_kg_m2, platform.stiffness_nm_rad
    return float(np.sqrt(k / j) / (2.0 * np.pi)) if k > 0.0 and j > 0.0 else USUAL_HZ


class _Looks:
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
        per = max(1, LOOKED_AT // len(shares))
        out = []
        for share in shares:
            mine = [i for i, c in enumerate(self.choice) if c.share == share and size[i] > MIN_CHI_SQUARE]
            out += sorted(mine, key=lambda i: -size[i])[:per]
        return out

    def _share(self, i: int, k: int, w: int, way: Way) -> Share:
        key = (i, k, w)
        if key not in self._shares:
            trace = measured(way.truth, self.choice[i].planned, self._sensor)
            found = share_of(way.model, shots_of(way.model, trace))
            g = self._weight
            self._shares[key] = Share(g * found.squares, g * found.gradient, g * found.information)
        return self._shares[key]

    def separation(self, chosen: Sequence[int], k: int) -> float:
        """Chi square between the models of pair ``k`` after all chosen sets, in the worse direction."""
        left = []
        for w, way in enumerate(self.pairs[k].ways):
            several = [self._share(i, k, w, way) for i in chosen]
            total = several[0]
            for one in several[1:]:
                total = total + one
            left.append(total.left(way.prior))
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
        for way in pair.ways:
            least = min(least, settled(way, plans, self._sensor, self._weight, MIN_CHI_SQUARE))
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


def _choose(looks: _Looks) -> list[int]:
    """Set by set, each the one that parts most; the shortest of those that do nearly as well.

    What looks best to first order is put to the proof, one after the other, until one stands.
    """
    chosen: list[int] = []
    reached, stands = 0.0, [0.0] * len(looks.pairs)
    while looks.shortlist and len(chosen) < MAX_SETS:
        gains = {i: looks.score([*chosen, i]) for i in looks.shortlist}
        best = max(gains.values())
        alike = sorted(
            (i for i, g in gains.items() if g > best - EQUIVALENT_SCORE_RATIO),
            key=lambda i: (looks.duration(i), -looks.choice[i].share),
        )
        others = sorted((i for i in gains if i not in alike), key=lambda i: -gains[i])
        order = _varied(looks, [*alike, *others])
        proofs: dict[int, list[float]] = {}
        for i in order[:PROOFS]:
            proofs[i] = looks.proved([*chosen, i], stands)
            if min(proofs[i]) >= GOOD:
                break
        winner = max(proofs, key=lambda i: _worth(proofs[i]))
        if chosen and _worth(proofs[winner]) < reached + 0.1:  # of the logarithm: nothing that would be seen
            break
        chosen.append(winner)
        stands = proofs[winner]
        reached = _worth(stands)
        if min(stands) >= GOOD:
            break
    return chosen


def _varied(looks: _Looks, order: Sequence[int]) -> list[int]:
    """The same order, but the best of every amplitude first: where one amplitude misleads, the next is another."""
    first: list[int] = []
    for i in order:
        if looks.choice[i].share not in {looks.choice[k].share for k in first}:
            first.append(i)
    return [*first, *(i for i in order if i not in first)]


def _section(sets: Sequence[Candidate], table: Table) -> dict[str, Any]:
    """The plan as an `excitation` section of a rig.yaml, checked as such."""
    entries = []
    for candidate in sets:
        entry = candidate.planned.excitation.model_dump(mode="json", exclude_defaults=True)
        entry = {"kind": candidate.planned.excitation.model_dump()["kind"]} | entry
        entry["name"] = f"{table.prefix}: {candidate.planned.excitation.describe()}"
        if not table.linear:
            entry["travel_cap_deg"] = float(f"{min(CAP * candidate.travel_deg, table.allowed.travel_deg):.3g}")
        entries.append(entry)
    section = {
        "sample_rate_hz": table.sensor.sample_rate_hz, "rest_s": table.rest_s, "scale_to_limits": True, "sets": entries
    }  # fmt: skip
    ExcitationConfig.model_validate_json(json.dumps(section), strict=True)
    return section


def with_follow_up(found: Identification, planned: FollowUp | None) -> Identification:
    """The identification with what is planned now, behind what was played; said in the verdict too."""
    if planned is None:
        return found
    before = found.follow_up
    if before is not None:
        planned = replace(before, plan=planned.plan, unparted=planned.unparted, note="")
    told = (*found.verdict.sentences, *verdict_sentences(planned, found.verdict.never_separable))
    return replace(found, follow_up=planned, verdict=replace(found.verdict, sentences=told))
