"""After the fit: the Cramer-Rao bound of each run and of all together, compared with the standard error reached.

The bound is that of `rig check` (see ``identifiability``), now at the identified values and on the samples that were
really recorded. Where the standard error that was reached lies at the bound, only a better sensor or more torque
helps; where it lies far above, the model's own error is the limit, and a better sensor would not help.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identify.bounds import advice
from identify.bounds.cramer_rao import Information, information_of, together
from identify.bounds.recorded import MIN_INFORMATIVE_SAMPLES, silent
from identify.model.parameters import Name
from identify.results import Identification, ParameterEstimate
from identify.signals.prepare import one_noise, prepare
from identify.signals.trace import Trace
from identify.wording import joined, percent
from rig.platform import TERMS
from rig.recording.run import Recording

MODEL_LIMITED_RATIO = 3.0  # times the bound above which the model, and not the sensor, is the limit
NARROW = 0.7  # of the bound below which a standard error is no longer believable
TOTAL = "all sets together"


@dataclass(frozen=True)
class BoundComparison:
    """What a run, or all together, could tell of J, C, K and what it did tell.

    Attributes
    ----------
    rank, parameters
        How many combinations of how many parameters show.
    expected
        Parameter -> one standard error over the value at the Cramer-Rao bound; infinite where nothing shows.
    achieved
        The same as reported; a parameter that was not reported is absent.
    sentence
        Both in words, and what to do.
    """

    name: str
    rank: int
    parameters: int
    condition: float
    expected: Mapping[str, float]
    achieved: Mapping[str, float]
    sentence: str


def compare_with_bound(found: Identification, recording: Recording) -> tuple[BoundComparison, ...]:
    """One entry a run, in the order played, and one for all together; nothing where no usable model came out.

    A run alone is looked at with the effects of the final model known, as each was fitted for itself.
    """
    platform = found.final.platform
    if platform is None or platform.inertia_kg_m2 <= 0.0:
        return ()
    traces = usable_traces(recording)
    with np.errstate(all="ignore"):
        each = [information_of(t, platform, len(traces)) for t in traces]
    if not each or not all(np.all(np.isfinite(i.matrix)) for i in each) or len({i.names for i in each}) > 1:
        return ()
    alone = [_terms_only(i) for i in each]
    sets = {one.name: one for one in found.per_set}
    out = [_compare(i, dict(sets[i.name].parameters), alone, False) for i in alone if i.name in sets and i.names]
    fitted = [i for i, t in zip(each, traces, strict=True) if t.run.use != "holdout"] or each
    whole = _compare(together(fitted), _as_terms(found.final.parameters), [], True)
    return (*out, whole)


def usable_traces(recording: Recording) -> list[Trace]:
    """The runs that are long enough to tell anything, all with one noise."""
    found = [prepare(silent(run), i, recording.noise) for i, run in enumerate(recording.runs)]
    usable = [t for t in found if t.stretches and t.count > MIN_INFORMATIVE_SAMPLES]
    return one_noise(usable, recording.noise is not None)


def _terms_only(information: Information) -> Information:
    """With the effects known."""
    for name in information.names:
        if len(name) > 1:
            information = information.without(name)
    return information


def _as_terms(parameters: Mapping[str, ParameterEstimate]) -> dict[str, ParameterEstimate]:
    """Ratios to the inertia under the name of the term above them."""
    return {name.removesuffix("_over_inertia"): estimate for name, estimate in parameters.items()}


def _compare(
    information: Information, reached: Mapping[str, ParameterEstimate], others: Sequence[Information], whole: bool
) -> BoundComparison:
    names: list[Name] = [n for n in information.names if n[0] in TERMS]
    expected = {n[0]: information.relative(n) for n in names}
    achieved = {n: abs(p.std_error / p.value) for n, p in reached.items() if n in expected and p.value != 0.0}
    i = information
    sentence = _sentence(i, expected, achieved, others, whole)
    return BoundComparison(TOTAL if whole else i.name, i.rank, len(i.names), i.condition, expected, achieved, sentence)


def _sentence(
    information: Information, expected: Mapping[str, float], achieved: Mapping[str, float],
    others: Sequence[Information], whole: bool,
) -> str:  # fmt: skip
    symbols = {n: advice.label((n,), information.torque_free) for n in expected}
    weak = [n[0] for n in advice.weak(information) if n[0] in expected]
    if weak:
        return advice.cure(information) if whole else advice.of_weak_set(information, others)
    lost = [symbols[n] for n in expected if n not in achieved]
    if lost:
        return f"the data are enough for {joined(lost)}, but the unexplained residual is not: find its cause first"
    far = {
        n: achieved[n] / expected[n]
        for n in achieved
        if expected[n] > 0.0 and achieved[n] > MODEL_LIMITED_RATIO * expected[n]
    }
    narrow = [n for n in achieved if achieved[n] < NARROW * expected[n]]
    if not far and narrow:
        bounds = joined([f"{symbols[n]} {_percent(expected[n])}" for n in narrow])
        return f"the interval is narrower than the sensor's noise allows: use {bounds} as the standard error"
    if not far:
        return "limited by sensor noise"
    worst = max(far, key=lambda n: far[n])
    return (
        f"limited by the unexplained residual: {symbols[worst]} has a standard error of {_percent(achieved[worst])}, "
        f"the sensor's noise would allow {_percent(expected[worst])}"
    )


def _percent(relative: float) -> str:
    return percent(100.0 * relative).lstrip("+")
