"""What a comparison reads of a result.json; keys that later versions add are passed over."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from identify.report.read_result import RESULT, read_result
from identify.report.value_codec import CodecError, decode
from identify.results import ParameterEstimate
from rig.errors import RecordingError

NEWEST = 1  # schema_version


@dataclass(frozen=True)
class SavedNumber:
    """A parameter; null stands for what is not finite."""

    value: float | None
    std_error: float | None = None
    ci95: tuple[float | None, float | None] | None = None
    unit: str = ""

    @property
    def has_interval(self) -> bool:
        """Whether anything is known of its uncertainty; one end may be open."""
        return self.value is not None and self.ci95 is not None and self.ci95 != (None, None)

    def estimate(self) -> ParameterEstimate:
        """The same with NaN for no value and infinity for an open end."""
        low, high = self.ci95 or (None, None)
        return ParameterEstimate(
            math.nan if self.value is None else self.value,
            math.inf if self.std_error is None else self.std_error,
            (-math.inf if low is None else low, math.inf if high is None else high),
            self.unit,
        )


@dataclass(frozen=True)
class SavedAbsence:
    """A parameter that was dropped or is not determined, and why."""

    name: str
    reason: str = ""


@dataclass(frozen=True)
class SavedErrors:
    """How far a model is from the data, as result.json has it."""

    residual_rms_torque: float | None = None
    holdout_rate_rms: float | None = None
    holdout_fit_percent: float | None = None
    residual_torque_relative: float | None = None
    holdout_torque_relative: float | None = None
    lowpass_hz: float | None = None
    holdout_measure: str = ""


@dataclass(frozen=True)
class SavedModel:
    """The declared model, or the final one."""

    parameters: Mapping[str, SavedNumber]
    effect_parameters: Mapping[str, Mapping[str, SavedNumber]] = field(default_factory=dict)
    error: SavedErrors = SavedErrors()
    dropped: tuple[SavedAbsence, ...] = ()
    not_determined: tuple[SavedAbsence, ...] = ()

    def absence(self, name: str) -> tuple[str, str]:
        """Of a parameter that is not there: "dropped" or "not determined" with the reason; empty where neither."""
        for word, several in (("dropped", self.dropped), ("not determined", self.not_determined)):
            for one in several:
                if one.name == name:
                    return word, one.reason
        return "", ""


@dataclass(frozen=True)
class SavedCandidate:
    """An effect that was tried."""

    effect: str
    status: str = ""


@dataclass(frozen=True)
class SavedVerdict:
    """What the model lacked."""

    effects: tuple[str, ...]
    confusable_with: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    candidates: tuple[SavedCandidate, ...] = ()


@dataclass(frozen=True)
class SavedDependence:
    """What a part of the disturbance depends on."""

    on: str
    torque_rms: float | None = None


@dataclass(frozen=True)
class SavedDisturbance:
    """What is left, as a torque."""

    torque_rms: float | None = None
    unit: str = ""
    relative: float | None = None
    depends_on: tuple[SavedDependence, ...] = ()
    moves_percent: Mapping[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class SavedNoiseFloor:
    """What no model can go below."""

    residual_rms_torque: float | None = None
    holdout_rate_rms: float | None = None


@dataclass(frozen=True)
class SavedResult:
    """A result.json."""

    accepted: bool
    before: SavedModel
    verdict: SavedVerdict
    after: SavedModel | None = None
    schema_version: int = NEWEST
    reasons: tuple[str, ...] = ()
    aborted: bool = False
    axis: Literal["rotary", "linear"] = "rotary"
    noise_floor: SavedNoiseFloor = SavedNoiseFloor()
    disturbance: SavedDisturbance | None = None

    @property
    def final(self) -> SavedModel:
        """The model that stands at the end."""
        return self.after or self.before

    @property
    def is_torque_free(self) -> bool:
        """Whether only ratios to the inertia are known."""
        return any(name.endswith("_over_inertia") for name in self.final.parameters)


def read_saved(folder: Path) -> SavedResult:
    """result.json of a results folder.

    Raises
    ------
    RecordingError
        Where there is none, or it is damaged or of a later version.
    """
    if not folder.is_dir():
        what = "is not a folder" if folder.exists() else "there is no such folder"
        raise RecordingError(f"{folder}: {what}: give the results folder of an identify-run")
    path = folder / RESULT
    if not path.exists():
        raise RecordingError(
            f"{folder}: has no {RESULT}: nothing was identified in it, so there is nothing to compare. `rig recover` "
            "says what was recorded, and identify-run identifies from it"
        )
    content = read_result(path)
    version = content.get("schema_version", NEWEST)
    if isinstance(version, int) and version > NEWEST:
        raise RecordingError(
            f"{path}: has schema_version {version}, this program reads {NEWEST}: use the version that wrote it"
        )
    try:
        return decode(SavedResult, content, [])
    except CodecError as error:
        raise RecordingError(f"{path}: is no result ({error}): restore it from a copy, or identify again") from None
