"""What is identified, as the conclusion takes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identify.diagnose.torque_regression import TorqueRegression
from identify.model.structure import Structure
from identify.residual import Disturbance
from identify.runs.holdout import Split
from identify.runs.measured_channels import Offer
from identify.signals.trace import Trace
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording


@dataclass(frozen=True)
class Case:
    """What is identified: the recording, the declared structure, and how it was laid out for the fits."""

    recording: Recording
    structure: Structure
    settings: IdentifyConfig
    traces: Sequence[Trace]
    split: Split
    offer: Offer
    torque_free: bool
    declared: Platform
    left_out: tuple[str, ...] = ()  # which runs, and why, in words
    disturbance: Disturbance | None = None  # what is left, where that is a torque and not the sensor's noise
    regression: TorqueRegression | None = None  # the runs in torque; None without one


def runs_fitted(case: Case) -> set[int]:
    """Numbers of the runs that the final fits look at."""
    return {t.number for t, m in zip(case.traces, case.split.final, strict=True) if np.any(m)}
