"""The final fits of the declared model and of the one that was found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.estimate.final_fit import FinalFit, by_output_error, by_regression
from identify.estimate.initial_guess import Start
from identify.likelihood.by_prediction_error import by_prediction_error, disturbance_support
from identify.likelihood.fit import Fit
from identify.model.parameter_fit import ParameterFit
from identify.model.structure import Structure
from identify.results import ParameterEstimate
from identify.runs.holdout import Split
from identify.select.evidence import STRONG_SUPPORT
from identify.select.search_state import Search
from identify.signals.trace import Trace, loads_differ
from identify.wording import joined, plain
from rig import effects
from rig.effects.base import Place
from rig.platform import TERMS, Platform

RUNS_FREE = 2.0**2  # reduced chi-square up to which the declared model is fitted by its free run
SIGNIFICANT_SIGMAS = 5.0  # standard errors from zero at which whole runs show damping


@dataclass(frozen=True)
class FinalModels:
    """Final fits on all samples that are not declared to be held out.

    Attributes
    ----------
    declared, structure
        The declared model, and what of it the runs can show.
    """

    traces: Sequence[Trace]
    split: Split
    declared: Platform
    structure: Structure
    start: Start
    say: Callable[[str], None]

    def before(self, search: Search) -> FinalFit:
        """The declared model."""
        # A decay is judged by its free run, which the regression does not look at.
        if all(t.torque is None for t in self.traces) or search.reduced_chi_square(search.base) < RUNS_FREE:
            fitted = by_output_error(
                self.traces, self.structure, search.base.values, search.horizon,
                self.split.final, self.split.everything,
            )  # fmt: skip
            is_final = fitted.sensor_limited and search.best.structure == self.structure
            return self._beside_disturbance(search.best, fitted) if is_final else fitted
        return self.regressed(search.base)

    def after(self, search: Search) -> FinalFit:
        """Output error where the model runs free at the sensor's noise; else prediction error with its disturbance.

        A decay is told by how it swings on, whatever disturbs it. A disturbance that the free run does not show may
        still move the parameters by many of the standard errors that they would have without.
        """
        structure = search.best.structure
        self.say(f"final fit with {joined([plain(name) for name in structure.effects]) or 'fewer terms'}")
        fitted = by_output_error(
            self.traces, structure, search.best.values, search.horizon,
            self.split.final, self.split.everything,
        )  # fmt: skip
        if fitted.sensor_limited:
            fitted = self._with_dropped_damping(search, self._without_unsupported(search, fitted))
            return self._beside_disturbance(search.best, fitted)
        if all(t.torque is None for t in self.traces):
            return fitted
        return self._predicted(search.best)

    def _beside_disturbance(self, searched: ParameterFit, fitted: FinalFit) -> FinalFit:
        """Values and errors of the likelihood that has a disturbance, where it tells one from none."""
        if not isinstance(searched, Fit) or searched.structure != fitted.structure:
            return fitted
        if any(t.torque is None for t in self.traces):
            return fitted
        support = disturbance_support(self.traces, self.split.final, searched, fitted.values)
        if not support > STRONG_SUPPORT:
            return fitted
        beside = by_prediction_error(
            self.traces, searched.structure, searched.values, self.split.final, self.split.everything, searched,
            coarse=False,
        )  # fmt: skip
        return replace(beside, fit=fitted.fit, sensor_limited=True)

    def _without_unsupported(self, search: Search, fitted: FinalFit) -> FinalFit:
        """The same without effects that whole runs do not support.

        The search looks at spans of the runs, and predicts a few samples ahead. A free run at the sensor's noise is the
        likelihood itself: what does not differ from none there, and is not missed, was found by chance.
        """
        for name in [e for e in fitted.structure.effects if e not in self.structure.effects]:
            if fitted.is_significant(name):
                continue
            rest = {n: v for n, v in fitted.values.items() if n[0] != name}
            less = by_output_error(
                self.traces, fitted.structure.minus(name), rest, search.horizon, self.split.final, self.split.everything
            )  # fmt: skip
            if less.sensor_limited and less.fit.penalised - fitted.fit.penalised < STRONG_SUPPORT:
                self.say(f"dropped {plain(name)}: whole runs are explained as well without it")
                search.drop(less.fit)
                fitted = less
        return fitted

    def regressed(self, best: ParameterFit) -> FinalFit:
        """A model by regression alone: where there is no time for more."""
        return by_regression(
            self.traces, best.structure, best.structure.shapes_of(best.values), self.start,
            self.split.final, self.split.everything, best.std_errors(),
        )  # fmt: skip

    def _predicted(self, best: ParameterFit) -> FinalFit:
        return by_prediction_error(
            self.traces, best.structure, best.values, self.split.final, self.split.everything
        )  # fmt: skip

    def _with_dropped_damping(self, search: Search, fitted: FinalFit) -> FinalFit:
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
        shows = damping > 0.0 if late else damping > SIGNIFICANT_SIGMAS * error
        if not fuller.sensor_limited:
            return fitted
        if not shows:
            return fitted.as_uncertain_as(fuller)
        search.dropped[:] = [d for d in search.dropped if d[0] != "damping"]
        self.say(f"restored damping: {damping:.4g} ± {error:.2g} over whole runs")
        return fuller

    def torque_scale(self, fitted: FinalFit) -> ParameterEstimate | None:
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
        return ParameterEstimate.normal(value, error, "1")
