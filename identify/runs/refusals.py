"""Recordings that nothing can be identified from, refused with what to do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.signals.trace import Trace
from rig.errors import RecordingError

MIN_USABLE_SAMPLES = 100  # samples: of 50 a stiffness was told thirty times more closely than they knew it
MIN_SIGNAL_TO_NOISE = 3.0  # times the sensor's noise that a motion has to reach


def refuse_without_motion(traces: Sequence[Trace], free: bool) -> None:
    """Refuse a recording in which nothing happens.

    Raises
    ------
    RecordingError
        Where no run moves more than the sensor's noise, or the torque never changes in any run.
    """
    moved = [float(np.std(t.measured[t.keep])) / max(t.noise, 1e-300) for t in traces]
    if max(moved) < MIN_SIGNAL_TO_NOISE:
        raise RecordingError(
            f"the motion of every run is at most {max(moved):.2g} times the sensor's noise (needed: "
            f"{MIN_SIGNAL_TO_NOISE:g}), so nothing can be identified: use more torque, or set recorded.noise if the "
            "noise is smaller than estimated"
        )
    steady = [t.torque is not None and float(np.ptp(t.torque.torque_nm)) == 0.0 for t in traces]
    if not free and all(steady):
        raise RecordingError(
            "the torque has the same value in every sample of every run: J, C and K need a torque that changes; "
            "check recorded.columns.torque, or set recorded.columns.torque: none for a free decay"
        )


def refuse_too_short(traces: Sequence[Trace]) -> None:
    """Refuse a recording so short that its noise, start states and bias hide what its motion tells.

    Raises
    ------
    RecordingError
        Where all runs together hold too few samples.
    """
    count = sum(t.count for t in traces)
    if count < MIN_USABLE_SAMPLES:
        raise RecordingError(
            f"{count} usable samples in all (needed: {MIN_USABLE_SAMPLES}): too few to separate J, C and K from the "
            "initial states: record at least a few periods of the platform's natural oscillation"
        )


def refuse_added_inertia(traces: Sequence[Trace]) -> None:
    """Refuse a known mass on a platform whose inertia is the unit of everything.

    Raises
    ------
    RecordingError
        Where a run without torque says that an inertia was added.
    """
    loaded = [t.run for t in traces if t.run.added_inertia_kg_m2]
    if loaded:
        raise RecordingError(
            f"{loaded[0].name} was recorded with an added inertia of {loaded[0].added_inertia_kg_m2:g} and without "
            "torque: only ratios to the inertia can be known, so the added inertia cannot be used; identify the runs "
            "of each load separately, without added_inertia_kg_m2 and with model.inertia_kg_m2 of the loaded platform"
        )


def refuse_lowpass(traces: Sequence[Trace], lowpass_hz: float | None) -> None:
    """Refuse a low-pass above what the samples can hold.

    Raises
    ------
    RecordingError
        Where the cut-off is half of a run's sample rate or more.
    """
    slowest = max(traces, key=lambda t: t.step_s)
    half_hz = 0.5 / slowest.step_s
    if lowpass_hz is not None and lowpass_hz >= half_hz:
        raise RecordingError(
            f"identify.lowpass_hz is {lowpass_hz:g}, and {slowest.run.name} contains nothing above {half_hz:g} Hz "
            "(half of its sample rate): lower it, or remove the key to have it chosen from the data"
        )
