"""One recording in, one identification out: fit, residual, effect, refit, verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from identify.conclude.case import Case
from identify.conclude.conclusion import conclude
from identify.conclude.contribution import contributions
from identify.conclude.decay_disturbance import left_of_a_decay
from identify.conclude.declared_values import declared_values
from identify.conclude.error_figures import floor_of, in_torque, measure
from identify.conclude.next_steps import interrupted_reason
from identify.estimate.final_fit import Fitted, by_output_error, by_regression
from identify.estimate.initial_guess import Start, first_guess
from identify.estimate.judged import Judged
from identify.genetic.per_set import each_set
from identify.likelihood.by_prediction_error import by_prediction_error
from identify.model.parameters import Name
from identify.model.structure import Structure, shape_values
from identify.results import (
    UNITS,
    Dependence,
    Identification,
    ParameterEstimate,
    SetResult,
)
from identify.rivals import run_heterogeneity
from identify.rivals.coloured_noise import Colour, with_noise_known
from identify.rivals.tone_origin import TONE, standing_line, told
from identify.rivals.whiteness_test import too_much_for
from identify.rivals.whole_runs import WholeRuns
from identify.runs.clipping import full_scale_of
from identify.runs.holdout import Split, split
from identify.runs.measured_channels import offer_of, with_causes
from identify.runs.observability import why_unseen
from identify.runs.refusals import refuse_added_inertia, refuse_lowpass, refuse_the_idle
from identify.runs.usable import runs_used
from identify.select.evidence import APART
from identify.select.field_search import Found, search_in_torque, with_curve
from identify.select.left_over import dependence_on
from identify.select.likelihood_search import LikelihoodSearch
from identify.select.search_state import Search
from identify.signals.prepare import channels_of, prepare
from identify.signals.torque_noise import quieter
from identify.signals.trace import Trace, loads_differ
from rig import effects
from rig.config.identify import IdentifyConfig
from rig.effects.base import Place
from rig.errors import Aborted
from rig.platform import TERMS, Platform
from rig.recording.run import Recording

NOTHING_YET = (
    "The search was interrupted; missing effects are not yet determined. Run identify-run on this recording again."
)
SHOWS = 5.0  # standard errors from zero at which whole runs show damping


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
        first = _Identifier(recording, declared, settings, say)
        found = first.run()
        if (
            found.aborted
            or first.torque_free
            or recording.noise is not None
            or not (found.verdict.unexplained or first.more_than_noise)
        ):
            return found
        return with_noise_known(
            found, lambda colour: _Identifier(recording, declared, settings, say, colour).run(), say
        )


class _Identifier:
    def __init__(
        self, recording: Recording, declared: Platform, settings: IdentifyConfig, say: Callable[[str], None],
        colour: Colour | None = None,
    ) -> None:  # fmt: skip
        self.recording, self.declared, self.settings, self.say, self.colour = recording, declared, settings, say, colour
        free = all(r.torque_nm is None or not np.any(r.torque_nm) for r in recording.runs)
        runs = with_causes(recording.runs, declared, settings.channels)
        runs = [replace(r, torque_nm=None, torque_time_s=None) if free else r for r in runs]
        beyond = full_scale_of(
            [r.rate_rad_s[r.valid & np.isfinite(r.rate_rad_s)] for r in runs if r.rate_rad_s is not None]
        )
        noise = recording.noise if colour is None else colour.level
        channels = channels_of(runs)
        traces = [prepare(r, i, noise, full_scale=beyond, channels=channels) for i, r in enumerate(runs)]
        self.traces, self.left_out = runs_used(traces, recording.noise is not None, recording.axis, say)
        self.torque_free = free
        self.torque_noise_above_hz: float | None = None
        self.curve: tuple[Dependence, dict[str, float]] | None = None  # over what is left of a decay
        self.more_than_noise = False  # is left by all that was found, though nothing else seemed to limit the runs
        refuse_the_idle(self.traces, free)
        if free:
            refuse_added_inertia(self.traces)
        self.split: Split = split(self.traces, settings.holdout)
        offer = offer_of(self.traces, declared, settings.channels)
        unseen = tuple((n, why) for n in declared.effects if (why := why_unseen(n, self.traces)))
        self.offer = replace(offer, idle=(*offer.idle, *unseen))
        still = {name for name, _ in self.offer.idle}
        names = tuple(n for n in declared.effects if n not in still)
        self.structure = Structure(declared.terms, names)
        self.start: Start = first_guess(self.traces, Structure(declared.terms))
        refuse_lowpass(self.traces, settings.lowpass_hz)
        if settings.lowpass_hz is not None:
            self.start = replace(self.start, cutoff_hz=settings.lowpass_hz)

    def run(self) -> Identification:
        """The whole way; where somebody stops it in the middle, what there is so far."""
        shapes = {n: shape_values(n, _plain(self.declared, n)) for n in self.structure.effects}
        search: LikelihoodSearch | None = None
        try:
            self.say("fitting the declared model")
            search = self._begun()
            at_noise = search.run() or self.colour is not None
            found, fits = search.found, WholeRuns(self.traces, self.split)
            both = all(t.beside is not None for t in self.traces)
            behind_a_lag = any(effects.get(e).lag is not None for e in found.best.structure.effects)
            noisy = self.torque_noise_above_hz is not None  # some of which is left in the band of the motion
            white = at_noise and not (both or behind_a_lag or noisy)  # as output error takes the noise of one channel
            nothing_left = search.stepwise.left is None or self.colour is not None
            if self.torque_free:
                left = search.stepwise.left
                self.curve = dependence_on(search.stepwise, left) if left is not None else None
                return self._concluded(found, fits)
            if (white and nothing_left) or self._other_cause(found, fits):
                return self._concluded(found, fits)
            self.say("a torque that was not recorded is left beside the sensor's noise")
            self.more_than_noise = True
            return self._in_torque(shapes, search, found)
        except (Aborted, KeyboardInterrupt):
            if search is None:
                raise
            return self._stopped(search.found)

    def _begun(self) -> LikelihoodSearch:
        """The search with the torque as it was recorded, or low-passed where the readings follow that better."""

        def begin(traces: Sequence[Trace]) -> LikelihoodSearch:
            return LikelihoodSearch.of(
                traces, self.split, self.structure, declared_values(self.declared, self.torque_free), self.start,
                self._allowed(), self.say,
            )  # fmt: skip

        search, less = begin(self.traces), None if self.torque_free else quieter(self.traces)
        if less is None:
            return search
        traces, cutoff_hz = less
        other = begin(traces)
        if other.stepwise.base.cost > search.stepwise.base.cost - APART:
            return search
        self.traces, self.torque_noise_above_hz = traces, cutoff_hz
        self.start = replace(first_guess(traces, Structure(self.declared.terms)), cutoff_hz=self.start.cutoff_hz)
        torque = "force" if self.recording.axis == "linear" else "torque"
        told = (
            f"the recorded {torque} is filtered: above {cutoff_hz:.3g} Hz it is noise that the platform does not follow"
        )
        self.left_out = (*self.left_out, told)
        self.say(told)
        return other

    def _other_cause(self, found: Search, fits: WholeRuns) -> bool:
        """Whether no effect but a few runs whose torque was another may be what is left."""
        return self._apart(found, fits, found.best.structure, found.best.values()) is not None

    def _concluded(self, search: Search, fits: WholeRuns) -> Identification:
        """Final fits, what else might pass for what was found, and the report."""
        before = self._before(search)
        after = self._after(search) if search.best.structure != self.structure else before
        after = self._doubted(search, fits, before, after)
        named = [e for e in after.structure.effects if e not in self.structure.effects]
        base = search.base.values()
        search.contribution = contributions(fits, after.structure, after.values, named, base, search.horizon)
        return self._report(search, before, after)

    def _stopped(self, search: Search) -> Identification:
        """What there is where somebody stops the search."""
        self.say("stopped: reporting what was found so far")
        found = self._report(search, self._regressed(search.base), self._regressed(search.best), in_full=False)
        if not found.verdict.effects:  # the search may have been about to name what this model lacks
            found = replace(found, verdict=replace(found.verdict, sentences=(NOTHING_YET,)))
        return replace(found, aborted=True, accepted=False, reasons=(interrupted_reason(found.verdict.effects),))

    def _in_torque(
        self, shapes: dict[str, tuple[float, ...]], search: LikelihoodSearch, found_there: Search
    ) -> Identification:  # fmt: skip
        """The way for measured data: what the model lacks is told by the torque that it leaves."""
        unit = UNITS[self.recording.axis]["torque"]
        found = search_in_torque(
            self.traces, self.split, self.structure, shapes, self.start, self._allowed(), unit, self.say,
            (search.stepwise.best, found_there), search.stepwise.trusted, search.stepwise.weigher.regression,
            dependence_on(search.stepwise, search.stepwise.left) if search.stepwise.left else None,
        )  # fmt: skip
        after = found.after
        gyro = all(t.channel == "rate" and t.beside is None for t in self.traces)  # an encoder has no line of its own
        line = standing_line(after, self.traces) if gyro and TONE in found.named else None
        if line is not None:
            found.search.leave_open(TONE, told(line, self.recording.axis, self.traces[0].channel), found.search.base)
            self.say(f"not named: {TONE}; the line may come from the sensor itself")
            found, after = found.taken_back(), found.before
        return self._report(found.search, found.before, after, measured=found)

    def _allowed(self) -> list[str]:
        """Names of the effects that may be named, in all their forms."""
        asked = self.settings.candidates
        names = [
            n for n in (effects.known() if asked is None else asked)
            if effects.get(n).reads is None or n in self.offer.candidates
        ]  # fmt: skip
        return [form for n in names for form in (n, *effects.forms(n))]

    def _doubted(self, search: Search, fits: WholeRuns, before: Fitted, after: Fitted) -> Fitted:
        """The final fit, or another one where something else may pass for what was found."""
        line = standing_line(after, self.traces) if TONE not in self.structure.effects else None
        named = after.structure, after.values
        apart = self._apart(search, fits, *named) if line is None or line.of_torque else None
        if apart is not None:
            search.leave_open("", run_heterogeneity.told(apart, self.recording.axis == "linear"), search.base)
            self.say("no effect is named: the runs disagree with each other, and that alone explains as much")
        elif line is not None:
            words = told(line, self.recording.axis, self.traces[0].channel)
            search.leave_open(TONE, words, self._until(search, fits, TONE))
            self.say(f"not named: {TONE}; the line may come from the sensor itself")
        elif too_much_for(after, self.structure.effects):
            search.take_all_back()
            self.say("no effect is named: three flexible effects still leave more than noise")
        else:
            return after
        return self._after(search) if search.best.structure != self.structure else before

    def _apart(
        self, search: Search, fits: WholeRuns, structure: Structure, values: dict[Name, float]
    ) -> run_heterogeneity.RunsApart | None:  # fmt: skip
        """What would explain all that the declared model leaves, if it is likelier than what was named."""
        apart = run_heterogeneity.runs_apart(fits, self.structure, search.base.values())
        if apart is None or structure == self.structure:
            return apart
        named = fits.fitted(structure, values)
        return apart if named is None or run_heterogeneity.as_likely(apart, named) else None

    @staticmethod
    def _until(search: Search, fits: WholeRuns, name: str) -> Judged:
        """The model of what was found before an effect; the declared one where that is nothing."""
        best, base = search.best.structure, search.base.structure
        found = best.effects[: best.effects.index(name)]
        start = {**search.base.values(), **{n: v for n, v in search.best.values().items() if n[0] in (*TERMS, *found)}}
        fitted = None if set(found) <= set(base.effects) else fits.fitted(replace(base, effects=found), start)
        return search.base if fitted is None else fitted.judged()

    def _report(
        self, search: Search, before: Fitted, after: Fitted, in_full: bool = True,
        measured: Found | None = None,
    ) -> Identification:  # fmt: skip
        changed = after.structure != self.structure
        after = after if changed else before
        cutoff = self.start.cutoff_hz
        measured_before = measure(self.traces, self.split, before, cutoff)
        measured_after = measure(self.traces, self.split, after, cutoff) if changed else measured_before
        floor = floor_of(self.traces, self.split, after, cutoff, self.recording.noise is not None)
        if measured is not None:
            measured_before, measured_after = (
                in_torque(m, e) for m, e in zip((measured_before, measured_after), measured.in_torque, strict=True)
            )
            floor = replace(floor, residual_rms_torque=measured.in_torque[1].floor_nm)
        if self.colour is not None:
            floor = replace(floor, holdout_rate_rms=self.colour.rms)
        per_set: tuple[SetResult, ...] = ()
        joint = None
        if in_full:
            self.say("fitting each set separately")
            d = self.declared
            centre = {
                "inertia": d.inertia_kg_m2, "damping": d.damping_nm_s_rad, "stiffness": d.stiffness_nm_rad
            }  # fmt: skip
            per_set, joint = each_set(
                self.traces, after, self.start, centre, self.settings, self.recording.axis
            )  # fmt: skip
        left = measured.disturbance if measured else None
        if self.torque_free:
            left = left_of_a_decay(self.traces, self.split, after, self.start, self.recording.axis)
            if self.curve is not None and after.structure != self.structure:
                left = with_curve(left, *self.curve)
        case = Case(
            self.recording, self.structure, self.settings, self.traces, self.split, self.offer, self.torque_free,
            self.declared, self.left_out, self.colour, left,
        )  # fmt: skip
        scale = self._torque_scale(after) if in_full else None
        return conclude(case, search, before, after, measured_before, measured_after, floor, per_set, joint, scale)

    def _torque_scale(self, fitted: Fitted) -> ParameterEstimate | None:
        """The shaft's torque over the recorded one, where a known inertia was added for some of the runs."""
        name = ("torque_scale", "scale")
        if not fitted.sensor_limited or not loads_differ(self.traces):
            return None
        if name not in fitted.names:
            fitted = by_output_error(
                self.traces, fitted.structure.plus("torque_scale"), {**fitted.values, name: 1.0}, 1.0,
                self.split.final, self.split.everything,
            )  # fmt: skip
        value, error = fitted.values[name], fitted.std_error(name)
        if not np.isfinite(error) or not fitted.determined[fitted.names.index(name)]:
            return None
        return ParameterEstimate(value, error, (value - 1.96 * error, value + 1.96 * error), "1")

    def _before(self, search: Search) -> Fitted:
        # A decay is judged by its free run, which the regression does not look at.
        if self.torque_free or search.base.sigma < 2.0 * search.floor:
            return by_output_error(
                self.traces, self.structure, search.base.values(), search.horizon,
                self.split.final, self.split.everything,
            )  # fmt: skip
        return self._regressed(search.base)

    def _after(self, search: Search) -> Fitted:
        """Output error where the model runs free at the sensor's noise; else prediction error with its disturbance."""
        structure = search.best.structure
        self.say(f"final fit with {', '.join(structure.effects) or 'fewer terms'}")
        fitted = by_output_error(
            self.traces, structure, search.best.values(), search.horizon,
            self.split.final, self.split.everything,
        )  # fmt: skip
        if fitted.sensor_limited:
            return self._with_dropped_damping(search, fitted)
        return self._predicted(search.best)

    def _predicted(self, best: Judged) -> Fitted:
        fitted, _ = by_prediction_error(
            self.traces, best.structure, best.values(), self.split.final, self.split.everything
        )  # fmt: skip
        return fitted

    def _regressed(self, best: Judged) -> Fitted:
        return by_regression(
            self.traces, best.structure, best.shapes(), self.start, self.split.final, self.split.everything,
            best.std_errors(),
        )  # fmt: skip

    def _with_dropped_damping(self, search: Search, fitted: Fitted) -> Fitted:
        """The same with damping, where whole runs show what a few periods of the held-out part could not.

        Beside a lag or a delay always: at a few tones below the resonance both turn the phase alike, and without the
        one the other would be told far more closely than the runs know it.
        """
        terms = (*fitted.structure.terms, "damping")
        if "damping" in fitted.structure.terms or "damping" not in self.declared.terms:
            return fitted
        structure = replace(fitted.structure, terms=tuple(t for t in TERMS if t in terms))
        start = {**fitted.values, ("damping",): 0.0}
        fuller = by_output_error(
            self.traces, structure, start, search.horizon, self.split.final, self.split.everything
        )  # fmt: skip
        damping, error = fuller.values[("damping",)], fuller.std_error(("damping",))
        late = any(effects.get(e).place in (Place.DRIVE, Place.SENSOR) for e in fitted.structure.effects)
        shows = damping > 0.0 if late else damping > SHOWS * error
        if not fuller.sensor_limited:
            return fitted
        if not shows:
            return fitted.as_uncertain_as(fuller)
        search.dropped[:] = [d for d in search.dropped if d[0] != "damping"]
        self.say(f"restored damping: {damping:.4g} +- {error:.2g} over whole runs")
        return fuller


def _plain(declared: Platform, name: str) -> dict[str, float]:
    effect = effects.get(name)
    return dict(zip((p.name for p in effect.parameters), effect.values(declared.effects[name]), strict=True))
