"""Identifications in which one effect passes for another: both models fitted to the same few sets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identify.bounds.cramer_rao import planned_trace, vector_of
from identify.estimate.output_error import refine
from identify.results import Errors, Identification, ModelResult, NoiseFloor, Verdict
from rig.excitation import PlannedSet, Sine
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import TRUTH, Effects, sine_run, traces_of

NOISE_RAD_S = math.radians(0.5)  # a cheap gyro: with a good one hardly anything passes for anything else
Guess = Mapping[str, Mapping[str, float]]


def soft_run(true: Platform, torque_nm: float, frequency_hz: float, duration_s: float, seed: int) -> Run:
    """A sine that sets in so softly that the platform does not ring: all of one amplitude, which tells the least."""
    planned = PlannedSet("soft", Sine(torque_nm=torque_nm, frequency_hz=frequency_hz, duration_s=duration_s,
                                      soft_start_s=0.5 * duration_s))  # fmt: skip
    run = planned_trace(true, planned, 1000.0, NOISE_RAD_S).run
    assert run.rate_rad_s is not None
    noise = NOISE_RAD_S * np.random.default_rng(seed).standard_normal(len(run.time_s))
    return replace(run, name=f"{frequency_hz:g} Hz soft", rate_rad_s=run.rate_rad_s + noise)


def confused(
    true: Effects, rival: Guess, torque_nm: float = 60.0, frequency_hz: float = 3.0, duration_s: float = 3.0
) -> tuple[Identification, Recording]:
    """``true`` (the last of it is the effect in question) and ``rival`` in its place, each fitted to one soft sine."""
    run = soft_run(Platform(*TRUTH, true), torque_nm, frequency_hz, duration_s, 1)
    ringing = sine_run(
        8.0, 1.0, effects=true, duration_s=1.0, noise=NOISE_RAD_S
    )  # a little of J, C and K apart from all else
    recording = Recording((run, ringing), noise=NOISE_RAD_S)
    (effect,), (other,) = list(true)[-1:], list(rival)
    named = fitted(Platform(*TRUTH, true), recording)
    passed = fitted(Platform(*TRUTH, {**{k: v for k, v in true.items() if k != effect}, **rival}), recording)
    errors = Errors(0.016, NOISE_RAD_S, 99.0, 0.001, 0.001, 120.0)
    verdict = Verdict(
        effects=tuple(true), confusable_with={effect: (other,)}, never_separable={}, unexplained_fraction=0.0,
        unexplained=False, candidates=(), sentences=(), rival_models={effect: {other: passed}},
    )  # fmt: skip
    found = Identification(
        accepted=True, reasons=(), axis="rotary", before=ModelResult({}, {}, errors), verdict=verdict,
        after=ModelResult({}, {}, errors, platform=named), noise_floor=NoiseFloor(0.016, NOISE_RAD_S, "given"),
        per_set=(), joint=None, traces=(), holdout_note="",
    )  # fmt: skip
    return found, recording


def fitted(start: Platform, recording: Recording) -> Platform:
    """The platform that fits a record best, from a start nearby."""
    traces = traces_of(recording)
    structure, names, values = vector_of(start, len(traces))
    return refine(traces, structure, dict(zip(names, values.tolist(), strict=True)), None, 15).platform()
