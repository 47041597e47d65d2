"""Before fitting: what each recorded run can determine, one line each, for `rig check`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identify.bounds.cramer_rao import information_of, with_delay
from identify.bounds.planned import lines_of
from identify.estimate.initial_guess import Start, first_guess
from identify.estimate.regression import Regression, fit
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.platform import Platform
from rig.recording.run import Recording, Run

MIN_INFORMATIVE_SAMPLES = 40  # samples of a run: a run with no more is left out


def of_recorded_campaign(recording: Recording, declared: Platform) -> list[str]:
    """Lines on every run and on all together, at J, C, K that a quick regression finds in the data itself."""
    usable = [r for r in recording.runs if r.use != "holdout"] or list(recording.runs)
    traces = [prepare(silent(r), i, recording.noise) for i, r in enumerate(usable)]
    traces = [t for t in traces if t.stretches and t.count > MIN_INFORMATIVE_SAMPLES]
    if not traces or not any(np.ptp(t.measured) > 0.0 for t in traces):
        return []
    structure = Structure(declared.terms)
    found = _quick(traces, structure)
    if found is None:
        return [
            (
                "the declared model fits these runs too poorly for a prediction: run identify-run to see what they "
                "determine"
            )
        ]
    platform = Platform(*found, terms=declared.terms)
    late = [information_of(t, with_delay(platform) if t.torque is not None else platform, len(traces)) for t in traces]
    if any(i.torque_free for i in late) and not all(i.torque_free for i in late):
        late = [i for i in late if not i.torque_free]
    return lines_of(late, bool(late[0].torque_free))


def silent(run: Run) -> Run:
    """A run whose torque is zero throughout tells as much as one without."""
    return run if run.torque_nm is None or np.any(run.torque_nm) else replace(run, torque_nm=None, torque_time_s=None)


def _quick(traces: Sequence[Trace], structure: Structure) -> tuple[float, float, float] | None:
    start: Start = first_guess(traces, structure)
    solution = fit(Regression(traces, structure), {}, start.platform, start.rho)
    j, c, k = solution.jck
    return (j, c, k) if j > 0.0 and c >= 0.0 and k >= 0.0 else None
