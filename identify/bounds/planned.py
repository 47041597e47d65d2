"""Before playing or fitting: what each run can determine, one line each, for `rig check`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identify.bounds import advice
from identify.bounds.identifiability import Information, information_of, of_planned, with_delay
from identify.estimate.initial_guess import Start, first_guess
from identify.estimate.regression import Regression, fit
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.excitation import PlannedSet
from rig.platform import Platform
from rig.recording.run import Recording, Run

ASSUMED_NOISE_RAD_S = math.radians(0.05)  # the accuracy of the paper's gyro
MIN_SAMPLES = 40  # samples


def of_planned_campaign(
    platform: Platform, sets: Sequence[PlannedSet], sample_rate_hz: float, noise_rad_s: float | None
) -> list[str]:
    """Lines on every set, on all together, and on an unknown delay.

    Parameters
    ----------
    noise_rad_s
        One standard deviation of a gyro sample; None or 0 assumes 0.05 deg/s and says so.
    """
    if not sets:
        return []
    noise = noise_rad_s or ASSUMED_NOISE_RAD_S
    late = of_planned(with_delay(platform), sets, sample_rate_hz, noise)
    assumed = "" if noise_rad_s else " (assumed: not declared)"
    basis = (
        f"one standard error at the declared values; gyro noise {math.degrees(noise):.3g} deg/s per sample{assumed} at "
        f"{sample_rate_hz:g} Hz"
    )
    return [basis, *_lines(late, advice.DELAY_NAME[0] in platform.effects)]


def _lines(late: Sequence[Information], delay_declared: bool) -> list[str]:
    usable = [i for i in late if np.all(np.isfinite(i.matrix))]
    wild = [f"{i.name}: the declared model is unstable; nothing can be predicted" for i in late if i not in usable]
    if not usable:
        return wild
    plain = usable if delay_declared else [i.without(advice.DELAY_NAME) for i in usable]
    lines = [advice.of_set(i, plain) for i in plain]
    if len(plain) > 1 or advice.weak(plain[0]):
        lines.append(advice.of_campaign(plain))
    delay = "" if delay_declared else advice.of_delay(usable)
    return [*wild, *lines, *([f"all sets together: {delay}"] if delay else [])]


def of_recorded_campaign(recording: Recording, declared: Platform) -> list[str]:
    """Lines on every run and on all together, at J, C, K that a quick regression finds in the data itself."""
    usable = [r for r in recording.runs if r.use != "holdout"] or list(recording.runs)
    traces = [prepare(silent(r), i, recording.noise) for i, r in enumerate(usable)]
    traces = [t for t in traces if t.stretches and t.count > MIN_SAMPLES]
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
    return _lines(late, bool(late[0].torque_free))


def silent(run: Run) -> Run:
    """A run whose torque is zero throughout tells as much as one without."""
    return run if run.torque_nm is None or np.any(run.torque_nm) else replace(run, torque_nm=None, torque_time_s=None)


def _quick(traces: Sequence[Trace], structure: Structure) -> tuple[float, float, float] | None:
    start: Start = first_guess(traces, structure)
    solution = fit(Regression(traces, structure), {}, start.platform, start.rho)
    j, c, k = solution.jck
    return (j, c, k) if j > 0.0 and c >= 0.0 and k >= 0.0 else None
