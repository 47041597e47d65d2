"""The whole of rig.yaml as one frozen value."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from rig.config.base import Section
from rig.config.bench import BenchConfig
from rig.config.excitation import ExcitationConfig
from rig.config.identify import IdentifyConfig
from rig.config.limits import LimitsConfig
from rig.config.model import ModelConfig
from rig.config.recorded import RecordedConfig
from rig.config.simulated import SimulatedConfig

BACKENDS = ("simulated", "bench", "recorded")
# The name becomes part of a folder's name on any system.
_NOT_IN_A_NAME = re.compile(r'[\x00-\x1f\x7f/\\<>:"|?*]')


class Config(Section):
    """rig.yaml. ``backend`` and its section are required, all else suits the paper's platform.

    ``simulated`` is always there, for ``--dry-run``.
    """

    name: Annotated[str, Field(min_length=1, max_length=80)]
    """Name of the campaign, part of the results folder's name; the file's own name if left out."""
    backend: Literal["simulated", "bench", "recorded"]
    """simulated; bench: real devices; recorded: your own files. Its section is required."""
    model: ModelConfig = ModelConfig()
    """The expected platform, before anything is measured; or the path of a model.yaml."""
    limits: LimitsConfig = Field(default_factory=LimitsConfig)
    """What the machine may do, predicted before anything moves and checked on every tick."""
    excitation: ExcitationConfig = Field(default_factory=ExcitationConfig)
    """What is played; or the path of a follow_up.yaml."""
    simulated: SimulatedConfig = Field(default_factory=SimulatedConfig)
    """The simulated rig, hidden from the identifier; also for --dry-run and --emulate."""
    bench: BenchConfig | None = None
    """Real devices, or their emulators."""
    recorded: RecordedConfig | None = None
    """Recordings made elsewhere."""
    identify: IdentifyConfig = IdentifyConfig()
    """How to identify, and when to accept."""

    @field_validator("name")
    @classmethod
    def _name_fits_a_folder(cls, name: str) -> str:
        if not name.isprintable() or _NOT_IN_A_NAME.search(name) or name != name.strip(" ."):
            raise ValueError("is used as the name of a folder: use letters, digits, spaces, - _ . inside it")
        return name

    @field_validator("model")
    @classmethod
    def _torque_needs_an_inertia(cls, model: ModelConfig, info: ValidationInfo) -> ModelConfig:
        if model.inertia_unknown and info.data.get("backend") == "bench":
            raise ValueError(
                "inertia_unknown is true: the values of this model are per unit of inertia, so the motion under a "
                "torque cannot be predicted. Multiply all values in N m (N m s/rad, ...), damping and stiffness "
                "included, by the platform's inertia, set inertia_kg_m2 to it and remove inertia_unknown"
            )
        return model


def name_from_stem(stem: str) -> str:
    """The campaign's name where the file gives none."""
    return _NOT_IN_A_NAME.sub("_", stem).strip(" .")[:80].strip(" .") or "campaign"
