"""Measured channels as rig.yaml declares them, and as a model.yaml keeps them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Self, TypeVar

from pydantic import Field, model_validator

from rig.channels import MAX_CHANNELS, Channel, ChannelKind, name_fault
from rig.config.base import Positive, Section
from rig.config.parsing.suggestions import KeyFaults


class ChannelConfig(Section):
    """What a measured channel is: it may then serve as a cause in the ways of its kind."""

    kind: ChannelKind
    """What the channel measures; the kind says in which ways it may act."""
    unit: Annotated[str, Field(max_length=20)] = ""
    """Unit of the readings; the usual one of the kind if left out."""
    torque_constant_nm_a: Positive | None = None
    """Torque per current, N m/A, for kind: current; from the recorded torque if left out."""

    @model_validator(mode="after")
    def _constant_of_a_current(self) -> Self:
        if self.torque_constant_nm_a is not None and self.kind != "current":
            raise ValueError(f"torque_constant_nm_a belongs to kind: current, not to kind: {self.kind}: leave it out")
        return self

    def channel(self, name: str) -> Channel:
        """The channel of that name, its reference still to be found."""
        factor = self.torque_constant_nm_a if self.kind == "current" else 1.0
        return Channel(name, self.kind, self.unit, None, factor)


class ModelChannel(ChannelConfig):
    """A channel that effects of a model read; they do nothing at ``reference``."""

    reference: float
    """Reading at which the channel's effects do nothing, in the channel's unit."""

    def channel(self, name: str) -> Channel:
        """The channel of that name."""
        found = super().channel(name)
        return Channel(name, found.kind, found.unit, self.reference, found.factor)

    @classmethod
    def of(cls, channel: Channel) -> Self:
        """The section that keeps a channel."""
        constant = channel.factor if channel.kind == "current" else None
        return cls(
            kind=channel.kind, unit=channel.unit, reference=channel.reference or 0.0, torque_constant_nm_a=constant
        )


Given = TypeVar("Given", bound=Mapping[str, ChannelConfig])


def check_channels(given: Given) -> Given:
    """Check names and number of channels and make their effects known. Raises KeyFaults."""
    if not given:
        return given
    from rig import effects  # noqa: PLC0415  compiled kernels: not paid for by a config without channels
    from rig.errors import ConfigError  # noqa: PLC0415

    if len(given) > MAX_CHANNELS:
        raise ValueError(
            f"{len(given)} channels, at most {MAX_CHANNELS} are allowed: leave out those "
            "least likely to act on the platform"
        )
    wrong: list[tuple[tuple[str | int, ...], str]] = []
    for name, config in given.items():
        fault = name_fault(name)
        try:
            if not fault:
                effects.declare_channels([config.channel(name)])
        except ConfigError as error:
            fault = str(error)
        wrong += [((name,), fault)] if fault else []
    if wrong:
        raise KeyFaults(wrong)
    return given
