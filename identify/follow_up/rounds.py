"""What a played follow-up did: which pairs are told apart, and the error of the earlier model on the new data too."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from identify.bounds.bound_and_estimate import usable_traces
from identify.bounds.cramer_rao import vector_of
from identify.conclude.error_figures import measure
from identify.conclude.next_steps import USUAL_CUTOFF_HZ
from identify.estimate.final_fit import NEAR_FLOOR, FinalFit
from identify.follow_up.pairs import free_run
from identify.results import Errors, FollowUp, FollowUpRound, Identification
from identify.runs.holdout import Split, split
from rig.config.limits import LimitsConfig
from rig.platform import Platform
from rig.preflight import Peaks
from rig.recording.run import Recording

SEPARATION_GAIN = 1.0  # times as much as before that a further plan has to promise


def after_playing(
    first: Identification, newer: Identification, earlier_model: Platform | None, recording: Recording
) -> Identification:
    """``newer``, identified from all the data, with what the follow-up that ``first`` planned has brought.

    ``earlier_model`` is the final model from before the first follow-up.
    """
    before = first.follow_up
    assert before is not None and before.plan is not None  # it was played
    pairs = [(p.effect, p.rival) for p in before.plan.partings]
    apart = tuple(pair for pair in pairs if is_distinguished(newer, *pair))
    played = FollowUpRound(before.plan, apart, tuple(pair for pair in pairs if pair not in apart))
    without = errors_on(earlier_model, newer, recording) if earlier_model is not None else None
    return replace(newer, follow_up=FollowUp(None, (), (*before.rounds, played), "", without))


def is_distinguished(found: Identification, effect: str, rival: str) -> bool:
    """Whether one of the two is named and the other no longer passes for it."""
    confusable, named = found.verdict.confusable_with, found.verdict.effects
    one = effect in named and rival not in confusable.get(effect, ())
    other = rival in named and effect not in confusable.get(rival, ())
    return one or other


def promises_more(found: Identification) -> bool:
    """Whether a further plan promises each of its pairs more than the last one promised in vain."""
    follow_up = found.follow_up
    if follow_up is None or follow_up.plan is None:
        return False
    if not follow_up.rounds:
        return True
    before = {(p.effect, p.rival): p.separation for p in follow_up.rounds[-1].plan.partings}
    return any(p.separation > SEPARATION_GAIN * before.get((p.effect, p.rival), 0.0) for p in follow_up.plan.partings)


@np.errstate(all="ignore")
def errors_on(platform: Platform, found: Identification, recording: Recording) -> Errors | None:
    """The errors of a model on the samples that ``found`` was judged on; None where it cannot be simulated there."""
    traces = usable_traces(recording)
    _, names, values = vector_of(platform, 1 + max(t.number for t in traces))
    free = free_run(platform, traces)
    runs, held = math.isfinite(free.sigma), dict(zip(names, values.tolist(), strict=True))
    fitted = FinalFit(
        free, held, names, np.zeros((len(names),) * 2), free if runs else None,
        runs and free.reduced_chi_square < NEAR_FLOOR, (True,) * len(names), "as it stood",
    )  # fmt: skip
    cutoff = found.final.error.lowpass_hz or found.before.error.lowpass_hz or USUAL_CUTOFF_HZ
    return measure(traces, _judged_as(found, split(traces)), fitted, cutoff).errors


def _judged_as(found: Identification, parts: Split) -> Split:
    """With the samples that judged then, where the runs are the same."""
    judge = [t.holdout > 0.5 for t in found.traces]
    if [len(m) for m in judge] != [len(m) for m in parts.judge]:
        return parts
    return replace(parts, judge=judge, fit=[f & ~m for f, m in zip(parts.everything, judge, strict=True)])


def limits_of(found: Identification, limits: LimitsConfig, linear: bool) -> Peaks:
    """What recorded runs may be followed up with: the limits that the file gives, else what the machine has borne."""
    seen = [t for t in found.traces if t.torque_nm is not None]
    travel = max((_swing(t.angle_rad, t.time_s) for t in seen), default=0.0)
    rate = max((float(np.max(np.abs(t.rate_rad_s))) for t in seen), default=0.0)
    torque = max((float(np.max(np.abs(t.torque_nm))) for t in seen if t.torque_nm is not None), default=0.0)
    given = limits.model_fields_set if not linear else set()
    return Peaks(
        limits.travel_deg if "travel_deg" in given else math.degrees(travel),
        limits.rate_deg_s if "rate_deg_s" in given else math.degrees(rate),
        limits.torque_nm if "torque_nm" in given or (linear and "torque_nm" in limits.model_fields_set) else torque,
    )


def sample_rate_hz(recording: Recording) -> float:
    """Of the first run, to four digits, within what a rig plays at: at which a follow-up of recorded runs is played."""
    rate = 1.0 / float(np.median(np.diff(recording.runs[0].time_s)))
    return float(f"{min(max(rate, 10.0), 20_000.0):.4g}")


def _swing(angle_rad: np.ndarray, time_s: np.ndarray) -> float:
    """Largest deviation from a straight line: a gyro's bias makes a ramp of an angle that is its integral."""
    line = np.polynomial.Polynomial.fit(time_s, angle_rad, 1)
    return float(np.max(np.abs(angle_rad - line(time_s))))
