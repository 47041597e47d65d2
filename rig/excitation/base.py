"""What every kind of excitation set shares: a name, a length and a torque that depends on time alone."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator

from rig.signals import Use

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


def rise(x: Any) -> Any:
    """Smooth step from 0 at x <= 0 to 1 at x >= 1, its first two derivatives zero at both ends.

    A torque that jumps is not band-limited, and what happens between its samples would be guesswork.
    """
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


class ExcitationSet(BaseModel):
    """One stretch of torque, played from rest."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Annotated[str, Field(max_length=80)] = ""
    """Name in the report; made from the other keys if left out."""
    duration_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 10.0
    """Length, s; the torque is zero before and after."""
    repeat_scales: Annotated[tuple[Positive, ...], Field(max_length=20)] = ()
    """The set is played again with its torque multiplied by each of these."""
    travel_cap_deg: Positive | None = None
    """The set is reduced until its predicted travel is below this and within all limits, deg."""
    use: Use = "auto"
    """fit: for the parameters; holdout: only for selection and error; auto: the program chooses."""

    @field_validator("name")
    @classmethod
    def _name_is_printed(cls, name: str) -> str:
        if not name.isprintable():
            raise ValueError("contains an invisible character or one that reverses the text direction: remove it")
        return name

    @property
    def title(self) -> str:
        """The name, or a description of the set where it has none."""
        return self.name or self.describe()

    @property
    def sine_hz(self) -> float | None:
        """The frequency where the set is a single sine, else None."""
        return None

    @abstractmethod
    def describe(self) -> str:
        """A few words that tell the set from its neighbours."""

    @abstractmethod
    def shape(self, time_s: Any) -> Any:
        """Torque in N m between 0 and ``duration_s``; a float or an array of any shape."""

    def torque(self, time_s: Any) -> Any:
        """Torque in N m at seconds since the start of the set; a float or an array of any shape."""
        inside = (time_s >= 0.0) * (time_s <= self.duration_s)
        return self.shape(time_s) * inside
