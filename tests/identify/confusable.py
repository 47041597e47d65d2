"""Identifications in which one effect passes for another: both models fitted to the same few sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from identify.identifiability import vector_of
from identify.output_error import refine
from identify.results import Errors, Identification, ModelResult, NoiseFloor, Verdict
from rig.platform import Platform
from rig.recording.run import Recording
from tests.identify.simulated import NOISE_RAD_S, TRUTH, Effects, campaign, traces_of

Guess = Mapping[str, Mapping[str, float]]


def confused(
    true: Effects, rival: Guess, *, sets: Sequence[tuple[float, float]], duration_s: float = 3.0, seed: int = 0
) -> tuple[Identification, Recording]:
    """``true`` (the last of it is the effect in question) against ``rival`` in its place, each fitted to the record."""
    recording = replace(campaign(true, sets=sets, duration_s=duration_s, seed=seed), noise=NOISE_RAD_S)
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
