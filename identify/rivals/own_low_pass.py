"""The gyro's own low-pass where it shows but carries too little to be named: the numbers are those beside it.

Every gyro has one. It is no effect that the platform lacks, but what it does would be taken for inertia and damping,
however little of the torque that is; also beside another lag, which delays all of the motion alike. So it takes no
evidence as a name does: it is in the fit where it is likelier than not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from identify.estimate.final_fit import FinalFit
from identify.likelihood.by_prediction_error import as_final, fitted_on_all
from identify.likelihood.fit import Fit
from identify.model.parameters import Name
from identify.rivals.open_line import with_numbers_of
from identify.runs.holdout import Split
from identify.select.evidence import Evidence, inflation
from identify.select.field_search import Found
from identify.select.stepwise import Stepwise
from identify.select.trial_fits import FULL_ITERATIONS
from identify.signals.trace import Trace
from identify.wording import number

FORMS = ("sensor_lag_second_order", "sensor_lag")  # as data sheets have it; behind one of these, the other
BEGUN_SAMPLES = 0.2  # length of the low-pass that a fit begins from


def with_own_low_pass(
    found: Found, search: Stepwise, traces: Sequence[Trace], split: Split, say: Callable[[str], None]
) -> tuple[Found, str]:
    """The same with its numbers as they are beside the gyro's low-pass, and a note; unchanged where none shows.

    Where something is left over, a low-pass smooths that away and proves nothing.
    """
    gyro = all(t.channel == "rate" and t.beside is None and t.torque is not None for t in traces)
    structure = found.after.structure
    form = next((f for f in FORMS if f not in structure.effects), None)
    if not gyro or form is None or found.disturbance.depends_on or structure != search.best.structure:
        return found, ""
    if not isinstance(found.after.fit, Fit) or not _shows(search, form):
        return found, ""
    say("the rate sensor's own low-pass shows: fitting it beside what was found")
    start = {**found.after.values, (form, "time"): BEGUN_SAMPLES * search.problem.step_s}
    problem, richer = fitted_on_all(traces, structure.plus(form), start, split.final, found.after.fit)
    inflated = inflation(problem.columns_at(richer, with_variance=True), richer, [(form, "time")])
    if not (found.after.fit.cost - richer.cost) / inflated > _price(richer, found.after.fit):
        return found, ""
    beside = as_final(problem, richer, traces, split.everything)
    after = with_numbers_of(beside, found.after, traces, split.everything)
    return replace(found, after=after), _note(beside, (form, "time"))


def _shows(search: Stepwise, form: str) -> bool:
    """Whether all samples may show the low-pass, by what those tell that the search looked at."""
    now, seen = search.best, _evidence(search, form)
    more = max(1.0, search.samples / max(now.count, 1))
    return more * seen.gain / seen.inflation > _price(seen.fit, now)


def _evidence(search: Stepwise, form: str) -> Evidence:
    """Of the low-pass beside the best model, as the search has it or fitted now."""
    now, last = search.best, search.rounds[-1] if search.rounds else None
    if last is not None and last.now is now and form in last.tried:
        return last.tried[form]
    start = {**now.values, (form, "time"): BEGUN_SAMPLES * search.problem.step_s}
    fit = search.problem.fit(now.structure.plus(form), start, now.noise, FULL_ITERATIONS, now.shots, thorough=False)
    return search.weigher.evidence(form, now, fit)


def _price(richer: Fit, less: Fit) -> float:
    """What the parameters that one has more than the other have to bring (Schwarz 1978)."""
    return (richer.penalised - richer.cost) - (less.penalised - less.cost)


def _note(beside: FinalFit, name: Name) -> str:
    late = f"{number(1e3 * beside.values[name], 3)} ms"
    return (
        f"The rate sensor's own low-pass delays its readings by {late}. That is too little to be named as an effect, "
        "but the final fit includes it."
    )
