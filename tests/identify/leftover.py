"""Torque residuals of J, C and K fitted to a platform with one more effect, without any search."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy import signal

from identify.diagnose.diagnosis import Sensor, diagnose
from identify.diagnose.torque_residual import motion, torque_noise_floor, torque_residual
from identify.model.structure import Structure
from identify.residual import ResidualDiagnosis
from identify.results import RunTraces
from identify.signals.trace import UPSAMPLING, Trace
from rig.platform import Platform
from rig.recording.run import Array
from tests.identify.simulated import NOISE_RAD_S, TRUTH, Effects, campaign, traces_of

CUTOFF_HZ = 100.0
EDGE = slice(60, -60)  # the low-pass swings at the ends
JCK = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}


def leftover(effects: Effects | None = None, seed: int = 0) -> tuple[list[RunTraces], float]:
    """The runs of a campaign with what the best J, C and K leave, and how far that is above the noise floor."""
    return _leftover(json.dumps(effects), seed)


@cache
def _leftover(effects: str, seed: int) -> tuple[list[RunTraces], float]:
    traces = traces_of(campaign(json.loads(effects), seed=seed))
    parts = [torque_residual(t, Structure(), JCK, CUTOFF_HZ) for t in traces]
    left = [_flat(p.residual) for p in parts if p is not None]
    columns = [_flat(np.column_stack(motion(t, CUTOFF_HZ)[::-1])) for t in traces]
    stacked = np.concatenate([c[EDGE] for c in columns]), np.concatenate([y[EDGE] for y in left])
    more = np.linalg.lstsq(*stacked, rcond=None)[0]
    left = [y - c @ more for c, y in zip(columns, left, strict=True)]
    floor = torque_noise_floor(traces, JCK, CUTOFF_HZ, [t.keep for t in traces])
    size = float(np.sqrt(np.mean(np.concatenate([y[EDGE] for y in left]) ** 2)))
    runs = [_as_traces(t, y, np.array(TRUTH) + more) for t, y in zip(traces, left, strict=True)]
    return runs, size / floor


def diagnosed(effects: Effects | None = None, seed: int = 0) -> ResidualDiagnosis:
    """What is said of the leftover."""
    return _diagnosed(json.dumps(effects), seed)


@cache
def _diagnosed(effects: str, seed: int) -> ResidualDiagnosis:
    return diagnosis_of(*_leftover(effects, seed))


def diagnosis_of(runs: Sequence[RunTraces], over_floor: float = 1.0) -> ResidualDiagnosis:
    """The same for given runs."""
    sensor = Sensor(NOISE_RAD_S, Platform(*TRUTH), CUTOFF_HZ)
    return diagnose(runs, sensor, (over_floor, over_floor), ("N*m", "rad/s"))[1]


def _flat(y: Array) -> Array:
    """Without the constant and the ramp that a gyro's bias and start angle make."""
    nuisance = np.column_stack([np.ones(len(y)), np.linspace(-1.0, 1.0, len(y))])
    return np.asarray(y - nuisance @ np.linalg.lstsq(nuisance, y, rcond=None)[0])


def _as_traces(trace: Trace, left: Array, jck: Array) -> RunTraces:
    torque = trace.fine[3][::UPSAMPLING]
    b, a, _ = signal.cont2discrete(([1.0, 0.0], jck), trace.step_s, "bilinear")
    model = signal.lfilter(np.ravel(b), a, torque)
    time = trace.step_s * np.arange(len(left))
    return RunTraces(
        trace.run.name, time, trace.measured, trace.channel, trace.keep.astype(float), model, model, left, left,
        trace.fine[0][::UPSAMPLING], trace.fine[1][::UPSAMPLING], torque, np.zeros(len(left)), trace.run.frequency_hz,
    )  # fmt: skip
