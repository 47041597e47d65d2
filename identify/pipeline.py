"""One recording in, one identification out: fit, residual, effect, refit, verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np
from threadpoolctl import threadpool_limits

from identify.conclude.acceptance import INTERRUPTED_NOTE, REJECTED_TOGETHER, interrupted_reason
from identify.conclude.case import Case
from identify.conclude.conclusion import conclude
from identify.conclude.contribution import contributions
from identify.conclude.declared_values import declared_shapes, declared_values
from identify.conclude.error_figures import floor_of, in_torque, measure
from identify.conclude.final_models import FinalModels
from identify.diagnose.decay_disturbance import left_of_a_decay
from identify.estimate.final_fit import FinalFit
from identify.estimate.initial_guess import Start, first_guess
from identify.genetic.per_set import each_set
from identify.model.structure import Structure
from identify.results import UNITS, Dependence, Identification, SetResult
from identify.rivals.alternative_causes import AlternativeCauses
from identify.rivals.open_line import with_line_left_open
from identify.rivals.own_low_pass import beside_own_low_pass, with_own_low_pass
from identify.rivals.run_delays import aligned, told
from identify.rivals.stand_ins import with_stand_ins
from identify.rivals.whiteness_test import fails_whiteness_test, leaves_a_disturbance, leaves_more_than_noise
from identify.rivals.whole_runs import FreeRunFitter
from identify.runs.clipping import full_scale_of
from identify.runs.gyro_drift import without_drift
from identify.runs.holdout import Split, split
from identify.runs.measured_channels import offer_of, with_causes
from identify.runs.observability import why_unseen
from identify.runs.reading import describe_reading
from identify.runs.reduced import reduced
from identify.runs.refusals import refuse_added_inertia, refuse_lowpass, refuse_without_motion
from identify.runs.usable import runs_used
from identify.select.curve_rivals import still_offered
from identify.select.field_search import Judged, search_in_torque
from identify.select.free_form_residual import curves_left, dependence_on
from identify.select.likelihood_search import LikelihoodSearch, filtered, start_search
from identify.select.search_state import Found, Search
from identify.signals.prepare import channels_of, prepare
from identify.signals.trace import Trace, release
from rig import effects
from rig.config.identify import IdentifyConfig
from rig.errors import Aborted
from rig.platform import TERMS, Platform
from rig.recording.run import Recording


def identify(
    recording: Recording,
    declared: Platform,
    settings: IdentifyConfig,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Estimate J, C, K, find what the declared model lacks, and say what is left.

    Parameters
    ----------
    recording
        The runs; nothing else of their origin is known here.
    declared
        The model as declared: its terms and effects are fitted, its values are only the centre of the
        genetic algorithm's search range.
    settings
        The ``identify`` section.
    progress
        Receives a line now and then.

    Raises
    ------
    RecordingError
        Where no run holds enough usable samples.
    """
    say = progress or (lambda text: None)
    with threadpool_limits(1):  # small matrices: a second BLAS thread only waits
        return _Identifier(recording, declared, settings, say).run()


MOST_SEARCHES = 3  # each on runs whose clocks the one before has made to agree


class _Identifier:
    def __init__(
        self, recording: Recording, declared: Platform, settings: IdentifyConfig, say: Callable[[str], None],
    ) -> None:  # fmt: skip
        self.recording, self.declared, self.settings, self.say = recording, declared, settings, say
        free = all(r.torque_nm is None or not np.any(r.torque_nm) for r in recording.runs)
        runs = with_causes(recording.runs, declared, settings.channels)
        runs = [replace(r, torque_nm=None, torque_time_s=None) if free else r for r in runs]
        beyond = full_scale_of(
            [r.rate_rad_s[r.valid & np.isfinite(r.rate_rad_s)] for r in runs if r.rate_rad_s is not None]
        )
        channels = channels_of(runs)
        traces = [prepare(r, i, recording.noise, full_scale=beyond, channels=channels) for i, r in enumerate(runs)]
        self.traces, self.left_out = runs_used(traces, recording.noise is not None, recording.axis, say)
        self.left_out += describe_reading(recording.runs, say)
        self.torque_free, self.search = free, cast(LikelihoodSearch | None, None)  # that runs, or has run
        self.torque_noise_nm: float | None = None  # that was filtered out of the recorded torque
        self.curve: tuple[Dependence, dict[str, float]] | None = None  # over what is left of a decay
        refuse_without_motion(self.traces, free)
        if free:
            refuse_added_inertia(self.traces)
        self.split: Split = split(self.traces, settings.holdout)
        offer = offer_of(self.traces, declared, settings.channels)
        unseen = tuple((n, why) for n in declared.effects if (why := why_unseen(n, self.traces)))
        self.offer = replace(offer, idle=(*offer.idle, *unseen))
        self.structure = Structure(declared.terms, tuple(n for n in declared.effects if n not in dict(self.offer.idle)))
        self.start: Start = first_guess(self.traces, Structure(declared.terms))
        refuse_lowpass(self.traces, settings.lowpass_hz)
        if settings.lowpass_hz is not None:
            self.start = replace(self.start, cutoff_hz=settings.lowpass_hz)
        self.traces = without_drift(self.traces, self.start.cutoff_hz)

    def run(self) -> Identification:
        """The whole way; where somebody stops it in the middle, what there is so far."""
        shapes = declared_shapes(self.declared, self.structure)
        try:
            self.say("fitting the declared model")
            search, at_noise = self._searched()
            found = search.found
            in_torque = partial(self._in_torque, shapes, search, found)
            fits = FreeRunFitter(*(reduced(self.traces, self.split) if self.torque_free else (self.traces, self.split)))
            causes = AlternativeCauses(self.traces, fits, self.structure, self.recording.axis, self.say)
            both = all(t.beside is not None for t in self.traces)
            behind_a_lag = any(effects.get(e).lag is not None for e in found.best.structure.effects)
            noisy = self.torque_noise_nm is not None  # some of it in the band of the motion
            white = at_noise and not (both or behind_a_lag or noisy)  # as output error takes the noise of one channel
            nothing_left = search.stepwise.left is None
            if self.torque_free:
                left = search.stepwise.left
                self.curve = dependence_on(search.stepwise, left) if left is not None else None
                return self._concluded(found, causes, in_torque)
            if white and not nothing_left:  # a curve that a free run does not show is none of the platform's
                nothing_left = not leaves_more_than_noise(self._models().after(found))
            if (white and nothing_left) or causes.other_cause(found):
                release(search.stepwise.problem.traces)
                return self._concluded(found, causes, in_torque)
            return in_torque()
        except (Aborted, KeyboardInterrupt):
            if self.search is None:
                raise
            return self._stopped(self.search.found)

    def _searched(self) -> tuple[LikelihoodSearch, bool]:
        """The search, and whether its model predicts to the noise; anew where clocks may pass for effects."""
        given, moved = self.traces, None
        for number in range(1, MOST_SEARCHES + 1):
            self.search = search = self._begun()
            at_noise = search.run()
            before, moved = moved, aligned(self.traces, self.split.final, search.stepwise.best)
            if moved is None:
                moved = before
                break
            self.traces = moved.traces
            if number == MOST_SEARCHES or not moved.may_explain(search.stepwise):
                break
            self.say("the clocks of torque and rate differ between runs: searching again with that corrected")
        if moved is not None:
            self.left_out = (*self.left_out, told(given, self.traces))
        return search, at_noise

    def _begun(self) -> LikelihoodSearch:
        """The search with the torque as it was recorded, or low-passed where the readings follow that better."""

        def begin(traces: Sequence[Trace]) -> LikelihoodSearch:
            return LikelihoodSearch.of(
                traces, self.split, self.structure, declared_values(self.declared, self.torque_free), self.start,
                self._allowed(), self.say,
            )  # fmt: skip

        search, noise_nm = start_search(self.traces, begin)
        if noise_nm is None:
            return search
        self.traces, self.torque_noise_nm = list(search.traces), noise_nm
        self.start = replace(first_guess(self.traces, Structure(self.declared.terms)), cutoff_hz=self.start.cutoff_hz)
        self.left_out = (*self.left_out, note := filtered(noise_nm, self.recording.axis))
        self.say(note)
        return search

    def _concluded(
        self, search: Search, causes: AlternativeCauses, in_torque: Callable[[], Identification]
    ) -> Identification:  # fmt: skip
        """Final fits, what else might pass for what was found, and the report, or ``in_torque`` for that."""
        models, changed = self._models(), search.best.structure != self.structure
        before = models.before(search)
        after = models.after(search) if changed else before
        taken_back = causes.mark_undetermined(search, after)
        disturbed = not self.torque_free and leaves_a_disturbance(after, self.traces)
        if not taken_back and (disturbed or fails_whiteness_test(after, self.structure.effects)):
            if not self.torque_free:
                return in_torque()
            self.say("no effect is named: even with three effects that fit almost any curve, the residual is not white")
            search.reject_all()
            taken_back = True
        if taken_back:
            after = models.after(search) if search.best.structure != self.structure else before
        elif changed and self.search is not None:
            after, note = beside_own_low_pass(after, self.search.stepwise, self.traces, self.split, self.say)
            self.left_out = (*self.left_out, note) if note else self.left_out
        base, named = search.base.values, [e for e in after.structure.effects if e not in self.structure.effects]
        search.contribution = contributions(causes.fits, after.structure, after.values, named, base, search.horizon)
        found = self._report(search, before, after)
        if taken_back and self.torque_free:  # how little torque is left says nothing about a swing that goes astray
            verdict = replace(found.verdict, unexplained=True)
            found = replace(found, accepted=False, reasons=(*found.reasons, REJECTED_TOGETHER), verdict=verdict)
        return found

    def _stopped(self, search: Search) -> Identification:
        """What there is where somebody stops the search."""
        self.say("stopped: reporting what was found so far")
        models = self._models()
        found = self._report(search, models.regressed(search.base), models.regressed(search.best), in_full=False)
        if not found.verdict.effects:  # the search may have been about to name what this model lacks
            found = replace(found, verdict=replace(found.verdict, sentences=(INTERRUPTED_NOTE,)))
        return replace(found, aborted=True, accepted=False, reasons=(interrupted_reason(found.verdict.effects),))

    def _in_torque(
        self, shapes: dict[str, tuple[float, ...]], search: LikelihoodSearch, found_there: Search
    ) -> Identification:  # fmt: skip
        """The way for measured data: what the model lacks is told by the torque that it leaves."""
        self.say("the residual holds a torque that was not recorded, in addition to the sensor's noise")
        step, axis = search.stepwise, self.recording.axis
        most = {t: getattr(self.settings.accept, f"{t}_percent") for t in TERMS}
        found = search_in_torque(
            self.traces, self.split, self.structure, shapes, self.start, still_offered(step, self._allowed()),
            UNITS[axis]["torque"], self.say, Judged(step.best, found_there, curves_left(step, most)),
            step.trusted, step.weigher.regression, search.refutes,
        ).with_lines(step.best, step.problem.torque_nm)  # fmt: skip
        judged = partial(with_stand_ins, traces=self.traces, axis=axis, say=self.say)
        found = with_line_left_open(found, step, self.traces, self.split.everything, axis, self.say, judged)
        found, note = with_own_low_pass(found, step, self.traces, self.split, self.say)
        self.left_out = (*self.left_out, note) if note else self.left_out
        return self._report(found.search, found.before, found.after, measured=found)

    def _models(self) -> FinalModels:
        return FinalModels(self.traces, self.split, self.declared, self.structure, self.start, self.say)

    def _allowed(self) -> list[str]:
        """Names of the effects that may be named, in all their forms."""
        asked = self.settings.candidates
        names = [
            n for n in (effects.known() if asked is None else asked)
            if effects.get(n).reads is None or n in self.offer.candidates
        ]  # fmt: skip
        return [form for n in names for form in (n, *effects.forms(n))]

    def _report(
        self, search: Search, before: FinalFit, after: FinalFit, in_full: bool = True,
        measured: Found | None = None,
    ) -> Identification:  # fmt: skip
        changed = after.structure != self.structure
        after = replace(after, between_rivals=search.spread_between_rivals) if changed else before
        cutoff = self.start.cutoff_hz
        measured_before = measure(self.traces, self.split, before, cutoff)
        measured_after = measure(self.traces, self.split, after, cutoff) if changed else measured_before
        floor = floor_of(self.traces, self.split, after, cutoff, self.recording.noise is not None)
        if measured is not None:
            measured_before, measured_after = (
                in_torque(m, e) for m, e in zip((measured_before, measured_after), measured.in_torque, strict=True)
            )
            floor = replace(floor, residual_rms_torque=measured.in_torque[1].floor_nm)
        per_set: tuple[SetResult, ...] = ()
        joint = None
        if in_full:
            self.say("fitting each set separately")
            d = self.declared
            centre = dict(zip(TERMS, (d.inertia_kg_m2, d.damping_nm_s_rad, d.stiffness_nm_rad), strict=True))
            per_set, joint = each_set(self.traces, after, self.start, centre, self.settings, self.recording.axis)
        left = measured.disturbance if measured else None
        if self.torque_free:
            left = left_of_a_decay(self.traces, self.split, after, self.start, self.recording.axis)
            if self.curve is not None and after.structure != self.structure:
                left = left.with_free_form(*self.curve)
        case = Case(
            self.recording, self.structure, self.settings, self.traces, self.split, self.offer, self.torque_free,
            self.declared, self.left_out, left,
            None if self.torque_free or self.search is None else self.search.stepwise.weigher.regression,
        )  # fmt: skip
        scale = self._models().torque_scale(after) if in_full else None
        return conclude(case, search, before, after, measured_before, measured_after, floor, per_set, joint, scale)
