"""The errors before and after: torque residual, free run, and their noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.diagnose.torque_fit import TorqueErrors
from identify.diagnose.torque_residual import TorqueResidual, relative, torque_noise_floor, torque_residual
from identify.estimate.final_fit import FinalFit
from identify.genetic.linear_traces import linear_traces
from identify.model.structure import Structure
from identify.results import Errors, ModelResult, NoiseFloor
from identify.runs.holdout import Split
from identify.signals.low_pass import settled
from identify.signals.trace import Trace, pooled_noise
from rig.recording.run import Array

MAX_ERROR_GROWTH = 1.02  # times the declared model's error: less is chance


@dataclass(frozen=True)
class Measured:
    """One model's errors, with the series behind them."""

    errors: Errors
    torque: list[TorqueResidual | None]
    simulated: list[Array]


def measure(traces: Sequence[Trace], split: Split, fitted: FinalFit, cutoff_hz: float) -> Measured:
    """Errors of a fitted model on the samples of the final fit and on the held-out ones."""
    structure, along = fitted.structure, traces
    if fitted.sensor_limited:  # friction along the model's own motion knows when it sticks; a noisy sign does not
        structure, along = Structure(structure.terms), linear_traces(traces, fitted)
    parts = [torque_residual(t, structure, fitted.values, cutoff_hz) for t in along]
    inside = [settled(t.keep, t.step_s, cutoff_hz) for t in traces]
    everything = relative(parts, [m & i for m, i in zip(split.everything, inside, strict=True)])
    held = relative(parts, [m & i for m, i in zip(split.judge, inside, strict=True)])
    if fitted.free_run is None:
        simulated = [np.full(len(t.measured), np.nan) for t in traces]
        rms = fit = None
    else:
        simulated = fitted.free_run.simulated()
        rms, fit = _free_run(traces, split, simulated)
    errors = Errors(
        residual_rms_torque=everything[0] if everything else None,
        holdout_rate_rms=rms,
        holdout_fit_percent=fit,
        residual_torque_relative=everything[1] if everything else None,
        holdout_torque_relative=held[1] if held else None,
        lowpass_hz=cutoff_hz if everything else None,
    )
    return Measured(errors, parts, simulated)


def in_torque(measured: Measured, found: TorqueErrors) -> Measured:
    """The same with the torque figures of a search in torque, of the samples where the platform moves."""
    errors = replace(
        measured.errors, residual_rms_torque=found.residual_nm, residual_torque_relative=found.relative,
        holdout_torque_relative=found.held_relative, lowpass_hz=found.cutoff_hz,
        holdout_measure="holdout_torque_relative",
    )  # fmt: skip
    return replace(measured, errors=errors)


def _free_run(traces: Sequence[Trace], split: Split, simulated: Sequence[Array]) -> tuple[float | None, float | None]:
    error, signal = [], []
    for trace, mask, y in zip(traces, split.judge, simulated, strict=True):
        error.append((trace.measured - y)[mask])
        signal.append(trace.measured[mask] - (np.mean(trace.measured[mask]) if np.any(mask) else 0.0))
    e, s = np.concatenate(error), np.concatenate(signal)
    if len(e) == 0 or not np.all(np.isfinite(e)):
        return None, None
    return float(np.sqrt(np.mean(e**2))), float(
        100.0 * (1.0 - np.linalg.norm(e) / max(float(np.linalg.norm(s)), 1e-300))
    )


def floor_of(traces: Sequence[Trace], split: Split, fitted: FinalFit, cutoff_hz: float, given: bool) -> NoiseFloor:
    """What the sensor's noise alone leaves."""
    inside = [settled(t.keep, t.step_s, cutoff_hz) for t in traces]
    masks = [m & i for m, i in zip(split.everything, inside, strict=True)]
    torque = torque_noise_floor(traces, fitted.values, cutoff_hz, masks)
    return NoiseFloor(
        residual_rms_torque=None if np.isnan(torque) else torque,
        holdout_rate_rms=pooled_noise(traces),
        source="given" if given else "estimated",
    )


def grown(before: ModelResult, after: ModelResult | None) -> str:
    """Why an error in the table grew although the model is better; empty where none did."""
    if after is None:
        return ""
    old, new = before.error.holdout_rate_rms, after.error.holdout_rate_rms
    if old is None or new is None or new <= MAX_ERROR_GROWTH * old:
        return ""
    return (
        "The final model's held-out error in free run is larger than the declared model's. Over a whole run, a torque "
        "that was not recorded accumulates, so this error says little about the model; the torque residual decided."
    )
