"""The gyro's own low-pass where it shows but carries too little to be named: the numbers are those beside it.

Every gyro has one. It is no effect that the platform lacks, but what it does would be taken for inertia and damping,
however little of the torque that is; also beside another lag, which delays all of the motion alike. So it takes no
evidence as a name does: it is in the fit where it is likelier than not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.final_fit import FinalFit
from identify.likelihood.by_prediction_error import as_final, fitted_on_all
from identify.likelihood.fit import Fit
from identify.model.parameters import Name
from identify.rivals.open_line import with_numbers_of
from identify.rivals.tone_origin import TONE
from identify.runs.holdout import Split
from identify.select.disturbance_lines import lines_left
from identify.select.evidence import Evidence, inflation
from identify.select.free_form_residual import ON
from identify.select.search_state import Found
from identify.select.stepwise import Stepwise
from identify.select.trial_fits import FULL_ITERATIONS
from identify.signals.trace import Trace
from identify.wording import number

FORMS = ("sensor_lag_second_order", "sensor_lag")  # as data sheets have it; the likelier of the two
MEMORY = "free_memory"  # the curve over what the motion was before
BEGUN_SAMPLES = 0.2  # length of the low-pass that a fit begins from


def with_own_low_pass(
    found: Found, search: Stepwise, traces: Sequence[Trace], split: Split, say: Callable[[str], None]
) -> tuple[Found, str]:
    """The same with its numbers as they are beside the gyro's low-pass, and a note; unchanged where none shows.

    Where something is left over, a low-pass smooths that away and proves nothing, unless it explains that (see below).
    """
    depends = found.disturbance.depends_on
    if not isinstance(found.after.fit, Fit):
        return found, ""
    if depends and not _explains_all(found, search, traces):
        return found, ""
    after, note = beside_own_low_pass(found.after, search, traces, split, say, scored=False)
    explained = replace(found.disturbance, depends_on=()) if note else found.disturbance
    return replace(found, after=after, disturbance=explained), note


def _explains_all(found: Found, search: Stepwise, traces: Sequence[Trace]) -> bool:
    """Whether the likeliest low-pass explains all that is left.

    That may be spectral lines, none of which is left beside it: what a lag makes of a sine that is not quite its own
    stands at the sine's frequency. Or it depends on the past motion, which a low-pass remembers, too (behind a lag that
    was named already): then the low-pass is believed more than that curve.
    """
    depends = found.disturbance.depends_on
    lines = depends == (lines_left(search.best, search.problem.torque_nm),)
    memories = [c for c in (search.left, *search.doubtful) if c is not None and c.is_there]
    of_motion = all(d.on == ON[MEMORY] for d in depends) and all(c.form == MEMORY for c in memories)
    if not lines and not (memories and of_motion):
        return False
    form = _form_for(found.after, search, traces, scored=False)
    if form is None:
        return False
    there = _evidence(search, form)
    if lines:
        return lines_left(there.fit, search.problem.torque_nm) is None
    return all(there.support > c.evidence.support for c in memories)


def beside_own_low_pass(
    after: FinalFit, search: Stepwise, traces: Sequence[Trace], split: Split, say: Callable[[str], None],
    scored: bool = True,
) -> tuple[FinalFit, str]:  # fmt: skip
    """A final model with the numbers that it has beside the gyro's low-pass, and a note; unchanged where none shows.

    ``scored``: only a low-pass that its score promises is fitted. Where a large disturbance follows the readings, the
    score of one that is there may be small.
    """
    form = _form_for(after, search, traces, scored)
    if form is None:
        return after, ""
    say("the rate sensor's own low-pass shows: fitting it beside what was found")
    structure, known = search.best.structure, after.fit  # which holds a line that was left open, too
    values = {**search.best.values, **after.values}
    start = {**values, (form, "time"): BEGUN_SAMPLES * search.problem.step_s}
    if not isinstance(known, Fit) or known.structure != structure:
        known = search.best
    problem, richer = fitted_on_all(traces, structure.plus(form), start, split.final, known)
    less = known
    if known is not after.fit:  # which was fitted by its free run, or without the line
        less = problem.fit(structure, values, richer.noise)
    inflated = inflation(problem.columns_at(richer, with_variance=True), richer, [(form, "time")])
    if not (less.cost - richer.cost) / inflated > _price(richer, less):
        return after, ""
    beside = as_final(problem, richer, traces, split.everything)
    if any(after.is_significant(e) and not beside.is_significant(e) for e in after.structure.effects):
        return after, ""  # what takes the place of an effect is no property of the gyro that was there all along
    return with_numbers_of(beside, after, traces, split.everything), _note(beside, (form, "time"))


def _form_for(after: FinalFit, search: Stepwise, traces: Sequence[Trace], scored: bool) -> str | None:
    """The likeliest low-pass where gyros alone are read and the final model is the one that the search believes."""
    gyro = all(t.channel == "rate" and t.beside is None and t.torque is not None for t in traces)
    believed = after.structure in (search.best.structure, search.best.structure.minus(TONE))
    return _likeliest_form(search, scored) if gyro and believed else None


def _likeliest_form(search: Stepwise, scored: bool) -> str | None:
    """The likeliest low-pass that all samples may show, by what those tell that the search looked at; or None."""
    now, last = search.best, search.rounds[-1] if search.rounds else None
    more = max(1.0, search.samples / max(now.count, 1))
    least = np.log(max(search.samples, 2))
    forms = [form for form in FORMS if form not in now.structure.effects]
    if scored and last is not None and last.now is now:
        forms = [s.effect for s in last.scores if s.effect in forms and more * s.gain > least]
    seen = {form: _evidence(search, form) for form in forms}
    gains = {form: more * e.gain / e.inflation - _price(e.fit, now) for form, e in seen.items()}
    form = max(gains, key=gains.__getitem__, default=None)
    return form if form is not None and gains[form] > 0.0 else None


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
        f"The rate sensor's own low-pass delays its readings by {late}. It explains too little of the residual to "
        "be named as an effect, but the final fit includes it."
    )
