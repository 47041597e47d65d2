"""Identifications that ask for a follow-up, plans of one, and what a results folder says of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from identify.results import FollowUpPlan, Identification, Parting
from rig.recording.hdf5 import read_recording_h5
from tests.commands.identify_run.identifiers import Identifier
from tests.identify.sample import sample

Stub = Callable[..., Identifier]
FIRST_S = 0.5 + 0.4 + 0.05 + 0.2 + 0.4 + 0.05  # how long the two sets take on the sequencer's clock
AUTO = ("--set", "identify.follow_up=auto")
ENTRY = {"kind": "sine", "torque_nm": 5.0, "frequency_hz": 11.0, "duration_s": 0.4, "name": "follow-up: 11 Hz"}


def plan_of(number: int = 1, separation: float = 900.0, torque_nm: float = 5.0) -> FollowUpPlan:
    name = "follow-up" if number == 1 else f"follow-up {number}"
    entry = ENTRY | {"name": f"{name}: 11 Hz", "torque_nm": torque_nm}
    excitation = {"sample_rate_hz": 1000.0, "rest_s": 0.2, "sets": [entry]}
    partings = (Parting("coulomb_friction", "stribeck_friction", separation),)
    return FollowUpPlan(excitation, partings, 0.4, "A sine parts Coulomb friction from Stribeck friction.")


def doubtful() -> Identification:
    """Accepted, but one name has a rival."""
    found = sample(1.0)[0]
    confusable = {"coulomb_friction": ("stribeck_friction",), "torque_delay": ()}
    return replace(found, verdict=replace(found.verdict, confusable_with=confusable))


def sure() -> Identification:
    found = sample(1.0)[0]
    confusable: dict[str, tuple[str, ...]] = {"coulomb_friction": (), "torque_delay": ()}
    return replace(found, verdict=replace(found.verdict, confusable_with=confusable))


def result(out: Path) -> dict[str, Any]:
    return dict(json.loads((out / "result.json").read_text(encoding="utf-8")))


def names(out: Path) -> list[str]:
    return [run.name for run in read_recording_h5(out / "recording.h5").runs]
