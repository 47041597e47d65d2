"""What to run next after a campaign that was not accepted, for summary, report and result.json."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.bounds.jumps import JUMP
from identify.conclude.acceptance import INTERRUPTED, USUAL_CUTOFF_HZ, opposite_signs
from identify.diagnose import torque_sensor_noise
from identify.diagnose.torque_residual import dependence
from identify.diagnose.wording import is_significant
from identify.model.parameter_fit import reduced_chi_square
from identify.residual import FROM_RUN_TO_RUN, GAIN
from identify.results import GeneticRun, Identification, ResidualDiagnosis, RunTraces, follow_up_file_name
from identify.runs.sign_convention import SENTENCE
from identify.wording import PULSATING, capital, joined, number, plain

MIN_DEPENDENT_SHARE = 0.1  # share of the residual's power from which it is said to depend on a quantity
DRIVEN_RUN = {
    "rate": (
        "To separate friction from damping, vary the speed: add a slow ramp to a torque that is held and released, and "
        "repeat one set at a quarter and at half of its torque."
    ),
    "angle": (
        "To separate spring, backlash, cogging and gravity, vary the travel: add a slow ramp over the whole travel, "
        "and repeat one set at half of its torque; if gravity may act, repeat it with the base turned."
    ),
    "torque": (
        "To find an effect of the drive, vary the torque: repeat the sets at half of their torque, and if the drive "
        "reports the measured current, record it instead of the command."
    ),
    "time": (
        "The platform or a sensor drifts: warm up for ten minutes, play the first set again at the end, and check "
        "temperature and clamping."
    ),
    "history": (
        "To separate hysteresis, creep and a second mode, vary how long the torque acts: hold a constant torque for a "
        "minute and release it, and repeat one set at a quarter of its frequency."
    ),
    "frequency": (
        "To find what makes the spectral lines, play each set again at half its torque and at a frequency that is a "
        "few percent higher. Lines that move with the excitation come from the drive or the platform (a torque sent "
        "in steps, a gap); lines that stay come from the surroundings or the sensor."
    ),
}
DRIVEN_RUN["direction"] = DRIVEN_RUN["rate"]
BETWEEN_RUNS = (
    "J, C and K of the runs differ, and no effect here explains why: play the same frequency at half and at twice the "
    "torque, and then once more as before. If the numbers follow the travel, the platform or a sensor is nonlinear "
    "(compare a sensor's scale at small and large rates); if they do not return, the rig changed between the runs."
)
DRIVE_CHANGES = (
    "The drive passes on another share of the torque as it runs: look for a motor that warms up, a current limit by "
    "temperature or a supply that sags. Record the motor's current and take the torque from that."
)
CHANGING = {
    "inertia": "a crank, a linkage, a load that shifts or a second axis that stands elsewhere",
    "damping": "a magnet or a brake that is not centred, or a gap that changes",
    "friction": "a seal, a bearing or a cable that rubs at some places more than at others",
}
# What the steps above are called in the `excitation` section: only where a campaign was played is there one.
RAMP, SCALES, ABRUPT = "kind: ramp_hold_release", "repeat_scales: [0.5, 0.25]", "soft_start_s: 0"
KEYS = {
    "rate": (RAMP, SCALES),
    "direction": (RAMP, SCALES),
    "angle": (RAMP, SCALES),
    "torque": (SCALES,),
    "history": (RAMP,),
}
DECAY_RUN = {  # the same without a motor
    "rate": (
        "To separate friction from drag, vary the speed: release the platform from a larger and from a smaller angle, "
        "and record each decay until the platform rests."
    ),
    "angle": (
        "To separate spring, backlash and gravity, vary the travel: release the platform from both ends of its travel "
        "and record each decay until it rests; if gravity may act, repeat it with the base turned."
    ),
    "time": (
        "The platform or a sensor drifts: repeat the first release after ten minutes, and check temperature and "
        "clamping."
    ),
    "history": (
        "To separate hysteresis and creep, release the platform once immediately, and once after holding it for a "
        "minute."
    ),
}
DECAY_RUN["direction"] = DECAY_RUN["rate"]
LINEAR = {"rate": "speed", "angle": "position", "torque": "force"}
INDEPENDENT = (
    "The residual does not depend on rate, angle, torque or time. Look in its spectrum and in the frequency response "
    "at which frequencies it is large. If no multisine was played, add one (0.5 Hz to beyond the resonance); also "
    "record one run with zero torque and the drive enabled."
)


INDEPENDENT_DECAY = (
    "The residual does not depend on rate, angle or time: release the platform from other angles, record each decay "
    "until it rests, and play a campaign with torque: a decay determines only ratios and separates few causes."
)
COLOURED = (
    "The noise floor is estimated from the highest frequencies only. If the sensor's noise is larger at low "
    "frequencies (coloured), the residual may be that noise: record the sensor at rest with the drive off, and set "
    "recorded.noise to its rms."
)
REPEAT = "Play the campaign again and compare the results; `rig check` predicts what each set can determine."
RECORD_AGAIN = "Record the campaign again and compare the results."
IDENTIFY_AGAIN = "Identify this recording again and let the search come to its end; nothing has to be played for it."
NEAR_NOISE_CHI_SQUARE = 4.0**2  # reduced chi-square up to which a residual is little above an estimated floor
START_SAMPLES = 3  # of a run: the first ones
MAX_START_RATE_SHARE = 0.1  # of its largest rate, that they may have


def next_steps(found: Identification) -> tuple[str, ...]:
    """One sentence a step, the most telling first; where the identification was accepted only what was left open."""
    if found.accepted:
        return (found.verdict.tells_apart,) if found.verdict.tells_apart else ()
    if any(reason.startswith(INTERRUPTED) for reason in found.reasons):
        return (IDENTIFY_AGAIN,)  # what half a search leaves says nothing about the platform
    if opposite_signs(found):
        return (f"{capital(SENTENCE)}, then identify again.",)
    steps = []
    if found.final.not_determined:
        steps.append(_to_determine_all(found))
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
        steps.append(f"Lower torque_nm in {file} before you play it again." if stopped else f"Play {file}.")
    if found.aborted:
        steps.append("The campaign was aborted: play it again in full.")
    return tuple(steps) or (RECORD_AGAIN if found.recorded else REPEAT,)


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
        "start abruptly so that the platform rings, and raise the torque as far as the limits allow."
    )


def _to_determine_all(found: Identification) -> str:
    """The step for all that is not determined; what a jump in a kernel hides has its cure in its reason."""
    lost = [item.name for item in found.final.not_determined if JUMP not in item.reason]
    if not lost:
        return "Smooth the jump in the effect's kernel as the reason says, then identify this recording again."
    step, decays = to_determine(lost, torque_free(found)), torque_free(found)
    if decays or found.recorded:
        return step
    return f"{step}{_named_in_yaml((ABRUPT,))} `rig check` predicts what each set will determine."


def _named_in_yaml(keys: Sequence[str]) -> str:
    return f" In rig.yaml: {joined(keys)}." if keys else ""


def _to_explain(found: Identification) -> list[str]:
    if found.verdict.tells_apart:
        return [found.verdict.tells_apart]
    left = _diagnosis(found)
    if left is not None and left.moments:
        places = joined([f"in {m.run} from {m.from_s:.2f} to {m.to_s:.2f} s" for m in left.moments])
        return [f"Most of the residual lies {places}. Exclude it with from_s or to_s, or record the run again."]
    noisy = torque_sensor_noise.describe(found)
    return [noisy] if noisy else [*_by_dependence(found), *_coloured(found)]


def _coloured(found: Identification) -> list[str]:
    """A residual little above an estimated floor may be noise that is slower than what the estimate looks at."""
    error, floor = found.final.error.holdout_rate_rms, found.noise_floor
    near = error is not None and reduced_chi_square(error, floor.holdout_rate_rms) < NEAR_NOISE_CHI_SQUARE
    return [COLOURED] if near and floor.source == "estimated" else []


def _by_dependence(found: Identification) -> list[str]:
    """The run that separates what the residual depends on: what the verdict says of it, else its largest share."""
    late = _begun_in_motion(found.traces)
    if late:
        starts = "starts" if len(late) == 1 else "start"
        late = [
            f"{capital(joined(late))} {starts} in motion. Effects with memory (creep, hysteresis, a second mode) "
            "cannot be identified there, because their initial state is known only at rest. Start every recording "
            "before the torque."
        ]
    free = torque_free(found)
    if changing := _pulsating(found) or _changing(found):
        return [*late, changing]
    name, sentence = _dependence(found)
    runs = DECAY_RUN if free else DRIVEN_RUN
    if name not in runs:
        line = _at_a_line(found)
        return [*late, line or (INDEPENDENT_DECAY if free else INDEPENDENT)]
    keys = () if free or found.recorded else KEYS.get(name, ())
    advice = f"{sentence}{runs[name]}{_named_in_yaml(keys)}"
    if found.axis == "linear":
        for rotary, linear in LINEAR.items():
            advice = advice.replace(f" {rotary}", f" {linear}")
    return [*late, advice]


def _pulsating(found: Identification) -> str:
    """Where to look for what changes a parameter as a wave over the time; empty where most of what is left does not."""
    parts = () if found.disturbance is None else found.disturbance.depends_on
    most = max(parts, key=lambda d: d.relative, default=None)
    if most is None or most.wave_hz is None:
        return ""
    return (
        f"Something changes the {PULSATING[most.wave_on]} at {number(most.wave_hz, 3)} Hz: look for a machine, a fan "
        "or a controller that runs at this frequency, switch it off and record the runs again."
    )


def _changing(found: Identification) -> str:
    """Where to look for what changes with the angle or from run to run; empty where nothing does."""
    parts = () if found.disturbance is None else found.disturbance.depends_on
    most = max(parts, key=lambda d: d.relative, default=None)
    if most is not None and most.changes == FROM_RUN_TO_RUN:
        return BETWEEN_RUNS
    if most is not None and most.changes == GAIN:
        return DRIVE_CHANGES
    if most is None or most.changes not in CHANGING or most.on == "time":
        return ""
    position = "position" if found.axis == "linear" else "angle"
    return (
        f"The {most.changes} changes with the {position}: look for {CHANGING[most.changes]}. Record runs with a "
        f"small travel about several {position}s: each gives J, C and K at its {position}."
    )


def _dependence(found: Identification) -> tuple[str, str]:
    """What the residual depends on most, and a sentence that says so where the verdict does not; empty for nothing."""
    if found.disturbance is not None and found.disturbance.depends_on:
        return max(found.disturbance.depends_on, key=lambda d: d.relative).on, ""
    shares = dependence(found.traces, found.final.error.lowpass_hz or USUAL_CUTOFF_HZ)
    name, share = next(iter(shares.items()), ("", 0.0))
    if share >= MIN_DEPENDENT_SHARE:
        return name, f"{number(100.0 * share, 2)} % of the residual's power depends on the {name}. "
    left = _diagnosis(found)
    parts = {} if left is None else {"direction": left.direction, "history": left.memory}
    seen = {on: s.share for on, s in parts.items() if s is not None and is_significant(s, MIN_DEPENDENT_SHARE)}
    return (max(seen, key=seen.__getitem__), "") if seen else ("", "")


def _at_a_line(found: Identification) -> str:
    """What to do about a spectral line that the diagnosis found; empty where there is none."""
    left = _diagnosis(found)
    if left is None or not left.free_lines:
        return ""
    line = max(left.free_lines, key=lambda one: one.size)
    return (
        f"The residual has a line at {number(line.frequency_hz, 4)} Hz: record once with the drive off and once with "
        "it enabled at zero torque. A line that stays with the drive off comes from the surroundings or the sensor; "
        "switch off what rotates or vibrates at that frequency and record again."
    )


def _diagnosis(found: Identification) -> ResidualDiagnosis | None:
    return found.residual_before if found.after is None else found.residual_after


def _begun_in_motion(traces: Sequence[RunTraces]) -> list[str]:
    """Runs under torque whose first samples move as fast as a good part of the rest."""
    return [
        t.name for t in traces
        if t.torque_nm is not None
        and np.median(np.abs(t.rate_rad_s[:START_SAMPLES])) > MAX_START_RATE_SHARE * np.max(np.abs(t.rate_rad_s))
    ]  # fmt: skip


def _to_reach(runs: Sequence[GeneticRun]) -> str:
    hopeless = [r.name for r in runs if r.closed_form_objective is not None and r.closed_form_objective >= r.j_dec]
    if hopeless:
        return (
            f"{capital(joined(hopeless))}: even the closed-form optimum stays above J_dec, so more generations do not "
            "help: look at the residual of these sets, then record them again."
        )
    return (
        f"{capital(joined([r.name for r in runs]))}: the closed-form optimum lies below J_dec, but the search did not "
        "reach it: raise identify.genetic.generations or identify.genetic.restarts."
    )
