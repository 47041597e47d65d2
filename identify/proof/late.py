"""Late ticks of a proof: how many, and what of the error that remained they may have made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identify.proof.deviation import NO_MORE_THAN_NOISE, Deviation, beside
from identify.proof.plan import ALL, ProofPlan
from identify.proven import EffectProof, LateTicks
from rig.excitation import CompensatedSet
from rig.platform import Platform
from rig.recording.run import Recording, Run

# Share of the error that remained, from which on it is the late ticks that did not let it go, and not the name: as much
# as a name has to explain of the runs without compensation so that not it is to blame but its numbers.
MIN_REPRODUCED = 0.7


def late_ticks(run: Run) -> tuple[int, int]:
    """Deadlines of a run at which the torque of an earlier tick still stood, and how many ticks it has.

    By the instants of the recorded torque. A torque that stands for one and a half ticks or longer has missed the next
    deadline.
    """
    if run.torque_time_s is None or len(run.torque_time_s) < 2:
        return 0, 0
    apart_s = np.diff(run.torque_time_s)
    ticks = np.rint(apart_s / np.median(apart_s))
    return int(np.sum(np.maximum(ticks - 1.0, 0.0))), int(np.sum(np.maximum(ticks, 1.0)))


def late_of(
    plan: ProofPlan, recording: Recording, model: Platform, found: Mapping[tuple[str, str], Deviation]
) -> LateTicks | None:
    """The late ticks of the compensated runs, and what the model makes of the torque as it was played; None if none.

    The torque is recorded with the instants at which it was there, so the model can be given it as it was. What it then
    shows beside the linear model is no fault of the model.
    """
    runs = {run.name: run for run in recording.runs}
    played = [(one, runs[one.planned.name]) for one in plan.runs if one.variant == ALL and (one.set, ALL) in found]
    counts = np.array([late_ticks(run) for _, run in played]).reshape(-1, 2)
    late, ticks = (int(n) for n in np.sum(counts, axis=0))
    if late == 0:
        return None
    remained = unexplained = noise = 0.0
    for one, run in played:
        made = one.planned.excitation
        lead_s = made.lead_s if isinstance(made, CompensatedSet) else 0.0
        of_model, of_linear = beside(run, model, lead_s, recording.noise), found[one.set, ALL]
        keep = of_model.keep & of_linear.keep
        remained += float(np.sum(of_linear.error[keep] ** 2))
        unexplained += float(np.sum(of_model.error[keep] ** 2))
        noise += of_linear.noise**2 * float(np.sum(keep))
    if not remained > NO_MORE_THAN_NOISE**2 * noise:
        return LateTicks(late, ticks, None)
    left = math.sqrt(max(unexplained - noise, 0.0) / (remained - noise))
    return LateTicks(late, ticks, max(0.0, 1.0 - left))


def with_late_ticks(one: EffectProof, late: LateTicks | None) -> EffectProof:
    """A name that is not confirmed, with the late ticks as the reason where they are one; refuted by them is none.

    The model that is to be refuted predicts what was left, given the torque as it was played.
    """
    is_reason = late is not None and late.reproduced is not None and late.reproduced >= MIN_REPRODUCED
    if not is_reason or one.status not in ("partly", "refuted"):
        return one
    said = one.why.split(". ")[0]
    return replace(one, status="partly", why=f"{said}. Late ticks may account for the rest: play the proof again")
