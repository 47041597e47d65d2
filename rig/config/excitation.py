"""The `excitation` section: which sets are played, how fast, and what to do when one is too large."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from rig.config.base import Section
from rig.excitation import Chirp, FreeDecay, Multisine, RampHoldRelease, Sine

MIN_SET_SAMPLES = 40  # of a set; an arbitrary floor
MAX_SETS = 200
PAPER_SETS: tuple[tuple[float, float], ...] = ((300, 0.5), (300, 1.0), (250, 3.0), (200, 6.0), (150, 9.0))


def _kind(value: Any) -> Any:
    """The kind of a set; a set that does not say is a sine, as all sets of the paper are."""
    return value.get("kind", "sine") if isinstance(value, Mapping) else getattr(value, "kind", None)


AnySet = Annotated[
    Annotated[Sine, Tag("sine")]
    | Annotated[RampHoldRelease, Tag("ramp_hold_release")]
    | Annotated[Multisine, Tag("multisine")]
    | Annotated[Chirp, Tag("chirp")]
    | Annotated[FreeDecay, Tag("free_decay")],
    Discriminator(_kind),
]


def paper_sets() -> tuple[Sine, ...]:
    """The five sets of Fig. 6."""
    return tuple(Sine(torque_nm=torque, frequency_hz=hz) for torque, hz in PAPER_SETS)


class ExcitationConfig(Section):
    """What is played.

    ``rest_s`` of zero torque before each set lets the ring of the last one die out: the paper's platform
    rings at 29 Hz with a time constant of 0.9 s, and a set is taken to start from rest.
    """

    sample_rate_hz: Annotated[float, Field(ge=10, le=20_000)] = 1000.0
    """Ticks of the loop per second, Hz."""
    sets: tuple[AnySet, ...] = Field(default_factory=paper_sets)
    """What is played, in this order; the paper's five sines if left out."""
    rest_s: Annotated[float, Field(ge=0, le=3600)] = 12.0
    """Zero torque before each set, s, until the ring of the last one has died out."""
    scale_to_limits: bool = False
    """true: reduce a set that exceeds a limit; false: refuse it and say which torque passes."""
    margin: Annotated[float, Field(gt=0, le=1)] = 0.95
    """Share of the limits of travel, rate and torque up to which `scale_to_limits` scales a set."""

    @field_validator("sets")
    @classmethod
    def _one_to_two_hundred(cls, sets: tuple[AnySet, ...]) -> tuple[AnySet, ...]:
        # After the sets themselves, or one wrong set would also be reported as a list that is too short.
        if not 1 <= len(sets) <= MAX_SETS:
            raise ValueError(f"has {len(sets)} sets: give 1 to {MAX_SETS}, or leave the key out for the paper's five")
        return sets

    @model_validator(mode="after")
    def _sets_can_be_played_and_measured(self) -> Self:
        for number, planned in enumerate(self.sets):
            stated = (planned.sine_hz, getattr(planned, "from_hz", None), getattr(planned, "to_hz", None))
            highest_hz = max(hz or 0.0 for hz in stated)
            if highest_hz > self.sample_rate_hz / 2:
                raise ValueError(
                    f"sets.{number}: {highest_hz:g} Hz cannot be played at {self.sample_rate_hz:g} ticks a second: "
                    f"at most {self.sample_rate_hz / 2:g} Hz, or raise sample_rate_hz"
                )
            if planned.duration_s * self.sample_rate_hz < MIN_SET_SAMPLES:
                count = planned.duration_s * self.sample_rate_hz
                raise ValueError(
                    f"sets.{number}: {planned.duration_s:g} s are {count:.3g} samples at {self.sample_rate_hz:g} Hz, "
                    "too few to identify from: duration_s has to be at least "
                    f"{MIN_SET_SAMPLES / self.sample_rate_hz:g} s"
                )
        return self
