"""From the final fits to the result: both models, verdict, acceptance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.bounds.damping_or_lag import lag_for_damping
from identify.conclude.acceptance import (
    of_reported,
    opposite_signs,
    reasons_against_disturbance,
    reasons_against_fit,
    unexplained_reason,
)
from identify.conclude.case import Case, runs_fitted
from identify.conclude.error_figures import Measured, grown
from identify.conclude.max_error import with_max_error
from identify.conclude.model_result import model_of, to_build_on
from identify.conclude.verdict import sentences_of
from identify.diagnose.diagnosis import with_diagnosis
from identify.diagnose.disturbance import disturbance_of
from identify.estimate.final_fit import FinalFit
from identify.genetic.per_set import has_arrived
from identify.model.parameter_fit import reduced_chi_square
from identify.model.structure import Structure
from identify.residual import Disturbance
from identify.results import (
    UNITS,
    GeneticRun,
    Identification,
    ModelResult,
    NoiseFloor,
    NotReported,
    ParameterEstimate,
    RunTraces,
    SetResult,
    Verdict,
)
from identify.rivals.whiteness_test import UNEXPLAINED_CHI_SQUARE
from identify.runs import clipping
from identify.runs.sign_convention import SENTENCE
from identify.select.search_state import Search
from identify.signals import glitches, resampling
from identify.signals.trace import UPSAMPLING, loads_differ, pooled_noise
from identify.wording import capital
from rig import effects
from rig.effects.base import Place

DIVERGED = 3.0**2  # reduced chi-square: a free run with friction may have gone astray
EXACT_MODEL_SHARE = 1e-6  # of the torque: what a model leaves where neither noise nor an effect is


def conclude(
    case: Case, search: Search, before: FinalFit, after: FinalFit, measured_before: Measured, measured_after: Measured,
    floor: NoiseFloor, per_set: tuple[SetResult, ...], joint: GeneticRun | None,
    torque_scale: ParameterEstimate | None = None,
) -> Identification:  # fmt: skip
    """The identification, of what the search found and the two final fits (the same where nothing changed)."""
    changed = after.structure != case.structure
    idle = tuple(NotReported(n, why) for n, why in case.offer.idle)
    declared = {*case.structure.terms, *case.structure.effects}  # what the search itself took up and gave up is no news
    dropped = (*idle, *(NotReported(n, why) for n, why in search.dropped if n in declared))
    result_before = model_of(case, before, measured_before, idle)
    result_after = model_of(case, after, measured_after, dropped) if changed else None
    if result_after is not None:
        result_after = to_build_on(case, after, result_after)
    else:
        result_before = to_build_on(case, before, result_before)
    final = result_after or result_before
    chi_square = _reduced_chi_square(case, after, search)
    measured = case.disturbance  # of runs that a torque limits; else the sensor's noise does
    left = measured_after.errors.holdout_torque_relative
    exact = left is not None and left < EXACT_MODEL_SHARE  # as in a file that has no noise
    unexplained = chi_square > UNEXPLAINED_CHI_SQUARE and not exact if measured is None else bool(measured.depends_on)
    verdict = Verdict(
        effects=tuple(
            dict.fromkeys(effects.first_of(e) for e in search.best.structure.effects if e not in case.structure.effects)
        ),
        confusable_with=search.rivals,
        never_separable=inseparable(search.best.structure, max(t.travel_deg for t in case.traces)),
        unexplained_fraction=_fraction(measured_before, measured_after, floor) if unexplained else 0.0,
        unexplained=unexplained,
        candidates=(*search.candidates, *case.offer.refused),
        sentences=(),
        rival_models=search.rival_models,
        contribution=search.contribution,
        left_open=search.left_open,
        tells_apart=search.tells_apart,
        explained_fraction=1.0 - _fraction(measured_before, measured_after, floor) if changed else 0.0,
    )
    searched = [g for g in (*(s.genetic for s in per_set), joint) if g is not None]
    if case.settings.j_dec is None:  # no search gets below its minimum: what is left there is judged as a torque
        searched = [g for g in searched if not has_arrived(g)]
    reasons = reasons_against_fit(searched if after.sensor_limited else (), final)
    reference, per_set = with_max_error(per_set, case.settings.reference)
    unsettled = measured is None and unexplained and not search.left_open
    seen = _seen_in_torque(case, after) if unsettled else measured
    if seen is not None:
        reasons += reasons_against_disturbance(of_reported(seen, final), case.settings.accept, case.recording.axis)
    # The band of the final errors holds the motion; the other reaches as far as the sensor tells a torque from noise.
    shares = [x for x in (left, None if seen is None else seen.relative) if x is not None]
    small = seen is not None and min(shares) <= _allowed_share(case)
    unknown = seen is None or not (measured or seen.depends_on or small)
    material = unexplained and unknown  # what is left, and nothing shows what it would do to J, C and K
    found = Identification(
        accepted=not reasons and not material, reasons=(), axis=case.recording.axis, before=result_before,
        verdict=verdict, after=result_after, noise_floor=floor, per_set=per_set, joint=joint,
        traces=_series(case, measured_before, measured_after), holdout_note=_note(case, after),
        max_error_percent=reference, torque_free=case.torque_free, torque_scale=torque_scale,
        scale_shows=loads_differ(case.traces), disturbance=seen or _at_the_sensor(case, measured_after, floor),
        note=grown(result_before, result_after),
    )  # fmt: skip
    if material:
        reasons.insert(0, unexplained_reason(chi_square, found))
    if opposite_signs(found):
        reasons.insert(0, SENTENCE)
    found = replace(found, accepted=not reasons, reasons=tuple(reasons))
    of_damping = _about_damping(case, after, final)
    said = (*sentences_of(found, damping_said=bool(of_damping)), *of_damping)
    return with_diagnosis(replace(found, verdict=replace(verdict, sentences=said)))


def _allowed_share(case: Case) -> float:
    return case.settings.accept.torque_percent / 100.0


def _seen_in_torque(case: Case, after: FinalFit) -> Disturbance | None:
    """What a free run leaves above the sensor's noise, as a torque: whether it matters is no question of the sensor."""
    if case.regression is None:
        return None
    fit = case.regression.solve(after.structure, after.structure.shapes_of(after.values))
    floor_nm = case.regression.noise_floor_nm(after.values)
    return disturbance_of(case.regression, fit, floor_nm, UNITS[case.recording.axis]["torque"])


def _at_the_sensor(case: Case, measured: Measured, floor: NoiseFloor) -> Disturbance | None:
    """What is left as a torque where the sensor's noise limits the runs; None without a torque."""
    left, least, relative = (
        measured.errors.residual_rms_torque, floor.residual_rms_torque, measured.errors.residual_torque_relative
    )  # fmt: skip
    if left is None or least is None or not relative:
        return None
    size = float(np.sqrt(max(left**2 - least**2, 0.0)))
    return Disturbance(size, UNITS[case.recording.axis]["torque"], size * relative / left)


def _about_damping(case: Case, after: FinalFit, final: ModelResult) -> tuple[str, ...]:
    """What C may be instead; nothing where C is not reported."""
    name = ("inertia",)
    if final.platform is None or name not in after.names or "damping" not in final.parameters:
        return ()
    fitted = [t for t in case.traces if t.number in runs_fitted(case)]
    sentence = lag_for_damping(final.platform, after.std_error(name), fitted, case.recording.axis)
    return (sentence,) if sentence else ()


def _note(case: Case, after: FinalFit) -> str:
    """What was held out, what was left out, and what was taken for granted."""
    rests = after.free_run is not None and any(s.rests for s in after.free_run.shots)
    resting = (
        "these runs hardly determine J: runs that begin at rest are assumed to begin exactly at rest" if rests else ""
    )
    torn = glitches.describe([(t.run.name, t.glitches_s) for t in case.traces])
    beyond = clipping.describe([(t.run.name, *t.clipped) for t in case.traces], case.recording.axis)
    uneven = resampling.describe([(t.run.name, *t.scatter) for t in case.traces])
    return ". ".join(capital(note) for note in (case.split.note, resting, *case.left_out, torn, beyond, uneven) if note)


def _reduced_chi_square(case: Case, after: FinalFit, search: Search) -> float:
    """Of what is left: in free run where the model can run free, else over the horizon."""
    noise = pooled_noise(case.traces)
    if after.free_run is not None and after.sensor_limited:
        return reduced_chi_square(after.fit.sigma, noise)
    free = reduced_chi_square(after.free_run.sigma, noise) if after.free_run is not None else np.inf
    short = search.reduced_chi_square(search.best)
    frictions = [e for e in after.structure.effects if effects.get(e).place is Place.FRICTION]
    # One wrong standstill throws a free run off for good; else what a free run leaves is what is missing.
    return free if np.isfinite(free) and (free < DIVERGED or not frictions) else min(free, short)


def _series(case: Case, before: Measured, after: Measured) -> tuple[RunTraces, ...]:
    out = []
    for i, trace in enumerate(case.traces):
        angle, rate, _, torque, _ = trace.fine
        first, last = before.torque[i], after.torque[i]
        out.append(
            RunTraces(
                trace.run.name, trace.start_s + trace.step_s * np.arange(len(trace.measured)), trace.measured,
                trace.channel, trace.keep.astype(float), before.simulated[i], after.simulated[i],
                None if first is None else first.residual, None if last is None else last.residual,
                angle[::UPSAMPLING], rate[::UPSAMPLING], None if trace.torque is None else torque[::UPSAMPLING],
                case.split.judge[i].astype(float), trace.run.frequency_hz,
            )
        )  # fmt: skip
    return tuple(out)


def inseparable(structure: Structure, travel_deg: float) -> dict[str, str]:
    """The rivals of what is in the model that no data within the travel of these runs can exclude."""
    out = {}
    for name in structure.effects:
        for rival in effects.get(name).never_separable or {}:
            if why := effects.get(name).alike(rival, travel_deg):
                out[f"{name} / {rival}"] = why
    return out


def _fraction(before: Measured, after: Measured, floor: NoiseFloor) -> float:
    """Share of the squared residual above the noise floor that is left: of the torque, or of a decay's free run."""
    a, b = after.errors.residual_rms_torque, before.errors.residual_rms_torque
    f = floor.residual_rms_torque
    if a is None or b is None:
        a, b, f = after.errors.holdout_rate_rms, before.errors.holdout_rate_rms, floor.holdout_rate_rms
    if a is None or b is None or f is None:
        return 0.0
    excess = b * b - f * f
    return float(np.clip((a * a - f * f) / excess, 0.0, 1.0)) if excess > 0.01 * f * f else 0.0
