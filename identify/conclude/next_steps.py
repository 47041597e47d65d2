"""What to run next after a campaign that was not accepted: for the summary, the report and result.json alike."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from identify.diagnose import torque_noise
from identify.diagnose.torque_residual import dependence
from identify.results import GeneticRun, Identification, RunTraces, follow_up_file_name
from identify.runs.sign_convention import SENTENCE, signs
from identify.wording import capital, joined, number, percent, plain

TELLING = 0.1  # share of the residual's power from which it is said to go with something
USUAL_CUTOFF_HZ = 50.0
RUN = {
    "rate": "Friction and damping show at other speeds: add a slow ramp_hold_release set, and repeat one set at a "
    "quarter and at half of its torque (repeat_scales: [0.5, 0.25]).",
    "angle": "Spring, gap, cogging or gravity show along the travel: add a slow ramp_hold_release set over the whole "
    "travel, and repeat one set at half of its torque; where gravity may act, once more with the base turned.",
    "torque": "The drive shows at other torques: repeat the sets at half of their torque (repeat_scales: [0.5]), and "
    "record the measured current instead of the command where the drive reports one.",
    "time": "Something drifts: play the first set once more at the end, after a warm-up of ten minutes, and look at "
    "temperature and clamping.",
}
RELEASED_RUN = {  # the same without a motor
    "rate": "Friction and drag show at other speeds: release the platform from a larger and from a smaller angle, and "
    "record each until it rests.",
    "angle": "Spring, gap or gravity show along the travel: release the platform from both ends of its travel, record "
    "each until it rests; where gravity may act, once more with the base turned.",
    "time": "Something drifts: repeat the first release at the end, after ten minutes, and look at temperature and "
    "clamping.",
}
LINEAR = {"rate": "speed", "angle": "position", "torque": "force"}
OTHERWISE = (
    "The residual depends on none of rate, angle, torque and time: its spectrum and the frequency response show at "
    "which frequencies it is large. Add a multisine (0.5 Hz to beyond the resonance) if none was played, and one run "
    "with zero torque and the drive enabled."
)


RELEASED = (
    "The residual depends on neither rate nor angle nor time: release the platform from other angles, record each "
    "until it rests, and play a campaign with torque: a decay shows only ratios, and few causes."
)
COLOURED = (
    "The noise floor is estimated from the fastest changes alone. If the sensor's noise is slower (coloured), the "
    "residual may be that noise: record the sensor at rest with the drive off, and give the rms of the noise as "
    "recorded.noise."
)
NEAR_FLOOR = 4.0  # times the noise floor
AT_ONCE, MOVING = 3, 0.1  # first samples of a run, and the share of its largest rate that they may have


def next_steps(found: Identification) -> tuple[str, ...]:
    """One sentence a step, the most telling first; where the identification was accepted only what was left open."""
    if found.accepted:
        return (found.verdict.tells_apart,) if found.verdict.tells_apart else ()
    if opposite_signs(found):
        return (f"{capital(SENTENCE)}, then identify again.",)
    steps = []
    if found.final.not_determined:
        steps.append(to_determine([item.name for item in found.final.not_determined], torque_free(found)))
    if found.verdict.unexplained:
        steps += _to_explain(found)
    failed = [one.genetic for one in found.per_set if one.genetic and not one.accepted]
    if found.joint is not None and not found.joint.accepted:
        failed.append(found.joint)
    if failed and not found.verdict.unexplained:
        steps.append(_to_reach(failed))
    follow_up = found.follow_up
    if follow_up is not None and follow_up.plan is not None:
        file = follow_up_file_name(len(follow_up.rounds))
        stopped = "Tripped on" in follow_up.note  # as it stands the guard would stop it again
        steps.append(f"Lower torque_nm in {file} before you play it again" if stopped else f"Play {file}")
        steps[-1] += f": {follow_up.plan.why}"
    if found.aborted:
        steps.append("The campaign was aborted: run it again to its end.")
    return tuple(steps) or ("Run the campaign once more and compare: `rig check` says what each set can determine.",)


def opposite_signs(found: Identification) -> bool:
    """Whether torque and motion were recorded with opposite sign conventions."""
    seen = signs(found.traces, found.final.error.lowpass_hz or USUAL_CUTOFF_HZ) if found.traces else None
    return seen is not None and seen.opposite


def unexplained_reason(ratio: float, found: Identification) -> str:
    """Why a residual that stays is no matter of noise: in units of the sensor's noise, and of the signal.

    ``ratio`` is the residual over the sensor's noise.
    """
    error, share = found.final.error, ""
    force = "force" if found.axis == "linear" else "torque"
    relative = error.holdout_torque_relative
    if relative is not None and math.isfinite(relative):
        share = f"{percent(100.0 * relative).lstrip('+')} of the {force}"
    elif error.holdout_fit_percent is not None and math.isfinite(error.holdout_fit_percent):
        share = f"{percent(100.0 - error.holdout_fit_percent).lstrip('+')} of the motion"
    size = f"{number(ratio, 3)} times the sensor's noise"
    told = f"{share} ({size})" if share else size
    acts = "none of the effects tried describes it"
    if found.verdict.left_open:
        acts = "the verdict leaves open what part of it is"
    return f"the model leaves {told} unexplained: {acts}"


def torque_free(found: Identification) -> bool:
    """Whether all runs are decays."""
    return bool(found.traces) and all(t.torque_nm is None for t in found.traces)


def to_determine(several: Sequence[str], decays: bool) -> str:
    """What to record next for parameters that are known badly or not at all; ``decays`` says without a torque."""
    names = joined([plain(name.replace(".", " ")) for name in several])
    if decays:
        return f"To determine {names}: release the platform from a larger angle and record until it rests."
    return (
        f"To determine {names}: add a set at another frequency or a multisine (0.5 Hz to beyond the resonance), let it "
        "start abruptly (soft_start_s: 0) so that the platform rings, and raise the torque as far as the limits allow; "
        "`rig check` predicts what each set will determine."
    )


def _to_explain(found: Identification) -> list[str]:
    if found.verdict.tells_apart:
        return [found.verdict.tells_apart]
    left = found.residual_before if found.after is None else found.residual_after
    if left is not None and left.moments:
        places = joined([f"in {m.run} from {m.from_s:.2f} to {m.to_s:.2f} s" for m in left.moments])
        return [f"Most of the residual lies {places}. Leave that out with from_s or to_s, or record it again."]
    noisy = torque_noise.told(found)
    return [noisy] if noisy else [*_by_what_it_goes_with(found), *_coloured(found)]


def _coloured(found: Identification) -> list[str]:
    """A residual little above an estimated floor may be noise that is slower than what the estimate looks at."""
    error, floor = found.final.error.holdout_rate_rms, found.noise_floor
    near = error is not None and error < NEAR_FLOOR * floor.holdout_rate_rms
    return [COLOURED] if near and floor.source == "estimated" else []


def _by_what_it_goes_with(found: Identification) -> list[str]:
    shares = dependence(found.traces, found.final.error.lowpass_hz or USUAL_CUTOFF_HZ)
    name, share = next(iter(shares.items()), ("", 0.0))
    late = _begun_in_motion(found.traces)
    if late:
        late = [f"{capital(joined(late))} {'begins' if len(late) == 1 else 'begin'} in motion: effects with memory "
                "(creep, hysteresis, a second mode) cannot be found there, because their start state is known only at "
                "rest. Start every recording before the torque."]  # fmt: skip
    free = torque_free(found)
    if share < TELLING:
        return [*late, RELEASED if free else OTHERWISE]
    run = RELEASED_RUN[name] if free else RUN[name]
    told = f"{number(100.0 * share, 2)} % of the residual's power depends on the {name}. {run}"
    if found.axis == "linear":
        for rotary, linear in LINEAR.items():
            told = told.replace(f" {rotary}", f" {linear}")
    return [*late, told]


def _begun_in_motion(traces: Sequence[RunTraces]) -> list[str]:
    """Runs under torque whose first samples move as fast as a good part of the rest."""
    return [
        t.name for t in traces
        if t.torque_nm is not None
        and float(np.median(np.abs(t.rate_rad_s[:AT_ONCE]))) > MOVING * float(np.max(np.abs(t.rate_rad_s)))
    ]  # fmt: skip


def _to_reach(runs: Sequence[GeneticRun]) -> str:
    hopeless = [r.name for r in runs if r.closed_form_objective is not None and r.closed_form_objective >= r.j_dec]
    if hopeless:
        return (
            f"{capital(joined(hopeless))}: even the closed-form optimum stays above J_dec, so more generations do not "
            "help; look at the residual of these sets first, and record them once more."
        )
    return (
        f"{capital(joined([r.name for r in runs]))}: the closed-form optimum lies below J_dec, but the search did not "
        "reach it: raise identify.genetic.generations or identify.genetic.restarts."
    )
