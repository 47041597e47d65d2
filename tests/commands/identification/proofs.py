"""A simulated rig with a hidden cubic spring, and identifications that name it, or something else."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from identify.results import Identification
from rig.platform import Platform
from rig.recording.hdf5 import read_recording_h5
from tests.identify.sample import sample

CUBIC_NM_RAD3 = 5000.0
TRUE = Platform(0.0203, 0.0447, 681.2, {"cubic_stiffness": {"factor": CUBIC_NM_RAD3}})
SPRUNG = f"""
backend: simulated
simulated:
  platform: {{inertia_kg_m2: 0.0203, damping_nm_s_rad: 0.0447, stiffness_nm_rad: 681.2,
    effects: {{cubic_stiffness: {{factor_nm_rad3: {CUBIC_NM_RAD3}}}}}}}
  amplifier: {{kind: hold, resolution_nm: 0.12}}
limits: {{frozen_gyro_ms: null}}
excitation:
  rest_s: 4
  sets:
    - {{torque_nm: 40, frequency_hz: 5, duration_s: 0.8}}
    - {{torque_nm: 35, frequency_hz: 7, duration_s: 0.8}}
"""
SETS = ["5 Hz", "7 Hz"]
PROOF = [
    "proof: 5 Hz", "proof: 5 Hz, compensated", "proof: 7 Hz, compensated", "proof: 7 Hz",
]  # fmt: skip
AUTO = ("--set", "identify.prove=auto")


def named(effects: Mapping[str, Mapping[str, float]], rivals: Mapping[str, Platform] | None = None) -> Identification:
    """Accepted, with these effects beside the true J, C and K; ``rivals`` of the first."""
    found = sample(1.0)[0]
    assert found.after is not None
    model = replace(TRUE, effects=effects)
    models = {next(iter(effects), ""): dict(rivals)} if rivals else {}
    verdict = replace(
        found.verdict, effects=tuple(effects), confusable_with={}, rival_models=models, contribution={}
    )  # fmt: skip
    return replace(found, after=replace(found.after, platform=model), verdict=verdict)


def right() -> Identification:
    return named(TRUE.effects)


def wrong() -> Identification:
    return named({"quadratic_damping": {"factor": 0.05}})


def result(out: Path) -> dict[str, Any]:
    return dict(json.loads((out / "result.json").read_text(encoding="utf-8")))


def names(out: Path) -> list[str]:
    return [run.name for run in read_recording_h5(out / "recording.h5").runs]
