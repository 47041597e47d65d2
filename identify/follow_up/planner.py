"""The follow-up: for a name that has a rival, the excitation that parts the two best within the limits.

Every shape at every amplitude is simulated on both models; what the loser could still take up is projected off
(``separation``), and the sets that part all pairs in the shortest time make the plan. Nothing here plays.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from identify.bounds.bound_and_estimate import usable_traces
from identify.follow_up.choice import MIN_CHI_SQUARE, PairSeparations, choose
from identify.follow_up.excitations import Candidate, candidates, fitting, shapes
from identify.follow_up.pairs import Pair, pairs_of
from identify.follow_up.separation import Sensor, coarser
from identify.follow_up.wording import verdict_sentences, why_of
from identify.results import FollowUp, FollowUpPlan, Identification, Parting, Unparted
from identify.wording import number
from rig import effects
from rig.config.excitation import ExcitationConfig
from rig.platform import Platform
from rig.preflight import Peaks
from rig.recording.run import Recording

FAINTEST_TORQUE_SHARE = 0.005  # of the largest torque played so far: drives take torque in steps of about a thousandth
FIRST_LOOK_SAMPLES_A_PERIOD = 30.0  # of the platform's own oscillation: no shape goes beyond three times its frequency
USUAL_HZ = 5.0  # where nothing swings
MIN_DAMPING_SHARE = 0.05  # of the identified one, where the runs hardly tell it
IN_DOUBT = 3.0  # times its interval
WELL_KNOWN_DAMPING_SHARE = 0.8  # of it, that far below
CAP = 1.3  # times the predicted travel: what a set may reach on a rig whose declared model is another one


@dataclass(frozen=True)
class PlanningLimits:
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
        limits = PlanningLimits(allowed, sensor, rest_s, prefix, found.axis == "linear", FAINTEST_TORQUE_SHARE * played)
        return _planned(pairs, without, limits, _least_damping(found))


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


def _planned(pairs: Sequence[Pair], without: list[Unparted], limits: PlanningLimits, least_damping: float) -> FollowUp:
    models: list[Platform] = []
    models += [m for p in pairs for m in p.models if m not in models]
    lighter = [replace(m, damping_nm_s_rad=least_damping * m.damping_nm_s_rad) for m in models]
    bearing = [*models, *(lighter if least_damping < WELL_KNOWN_DAMPING_SHARE else [])]
    own_hz = natural_hz(models[0])
    look, weight = coarser(limits.sensor, FIRST_LOOK_SAMPLES_A_PERIOD * own_hz)
    several = shapes(own_hz, limits.sensor.sample_rate_hz)
    choice = candidates(several, bearing, limits.allowed, look, limits.least_torque_nm)
    if not choice:
        why = f"no kind of excitation stays within the limits at {number(limits.least_torque_nm, 2)} N m or more"
        return FollowUp(None, (*without, *(Unparted(p.effect, p.rival, why) for p in pairs)))
    separations = PairSeparations(pairs, choice, models, look, weight)
    sets = [s for i in choose(separations) if (s := fitting(choice[i], bearing, limits.allowed)) is not None]
    partings, failed = [], list(without)
    for pair in pairs:
        best = separations.checked(sets, pair) if sets else 0.0
        if best >= MIN_CHI_SQUARE:
            partings.append(Parting(pair.effect, pair.rival, best))
        else:
            failed.append(Unparted(pair.effect, pair.rival, _too_little(pair, best)))
    if not partings:
        return FollowUp(None, tuple(failed))
    plan = FollowUpPlan(
        _section(sets, limits), tuple(partings), sum(c.planned.duration_s for c in sets), why_of(partings, sets)
    )
    return FollowUp(plan, tuple(failed))


def _too_little(pair: Pair, reached: float) -> str:
    """Why a pair has no part in the plan."""
    cure = effects.get(pair.effect).separated_by
    cure_note = f" (to distinguish it {cure})" if cure.startswith("from ") else ""
    return (
        f"no excitation within the limits separates them: the best reaches a chi-square of {number(reached, 2)}, "
        f"{MIN_CHI_SQUARE:g} is needed{cure_note}"
    )


def natural_hz(platform: Platform) -> float:
    """The frequency that a platform swings at, or a usual one where it has no spring."""
    j, k = platform.inertia_kg_m2, platform.stiffness_nm_rad
    return float(np.sqrt(k / j) / (2.0 * np.pi)) if k > 0.0 and j > 0.0 else USUAL_HZ


def _section(sets: Sequence[Candidate], limits: PlanningLimits) -> dict[str, Any]:
    """The plan as an `excitation` section of a rig.yaml, checked as such."""
    entries = []
    for candidate in sets:
        entry = candidate.planned.excitation.model_dump(mode="json", exclude_defaults=True)
        entry = {"kind": candidate.planned.excitation.model_dump()["kind"]} | entry
        entry["name"] = f"{limits.prefix}: {candidate.planned.excitation.describe()}"
        if not limits.linear:
            entry["travel_cap_deg"] = float(f"{min(CAP * candidate.travel_deg, limits.allowed.travel_deg):.3g}")
        entries.append(entry)
    section = {
        "sample_rate_hz": limits.sensor.sample_rate_hz, "rest_s": limits.rest_s, "scale_to_limits": True,
        "sets": entries,
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
    sentences = (*found.verdict.sentences, *verdict_sentences(planned, found.verdict.never_separable))
    return replace(found, follow_up=planned, verdict=replace(found.verdict, sentences=sentences))
