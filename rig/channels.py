"""Further measured channels that may serve as causes: what kinds there are, and in which ways each may act."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

ChannelKind = Literal["current", "temperature", "angle", "acceleration", "rate", "torque", "other"]
KINDS: tuple[ChannelKind, ...] = get_args(ChannelKind)
MAX_CHANNELS = 8  # each brings up to five candidates
_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")


@dataclass(frozen=True)
class Nature:
    """What a kind of channel is measured in, whether zero means that nothing acts, and how it may act."""

    unit: str
    from_zero: bool
    ways: tuple[str, ...]


NATURES: Mapping[str, Nature] = {
    "current": Nature("A", True, ("drive",)),
    "temperature": Nature("K", False, ("gain", "stiffness", "damping", "friction")),
    "angle": Nature("rad", False, ("torque", "stiffness")),
    "acceleration": Nature("rad/s^2", True, ("torque",)),
    "rate": Nature("rad/s", True, ("torque",)),
    "torque": Nature("N*m", True, ("drive", "torque")),
    "other": Nature("1", False, ("torque", "gain", "stiffness", "damping", "friction")),
}


@dataclass(frozen=True)
class Channel:
    """A measured channel by its name, with what turns its reading x into what acts: factor * (x - reference).

    Parameters
    ----------
    unit
        Of the readings; empty for the usual one of the kind.
    reference
        The reading at which it does nothing, so that J, C, K and all else are those there. None until it is known:
        zero where zero means that nothing acts (a current, an acceleration), else the first sample of the first run.
    factor
        N m per unit of a current that stands for a torque; None until it is known. One for all other kinds.
    """

    name: str
    kind: ChannelKind
    unit: str = ""
    reference: float | None = None
    factor: float | None = None

    @property
    def nature(self) -> Nature:
        """What its kind says."""
        return NATURES[self.kind]

    @property
    def measured_in(self) -> str:
        """The unit of a difference of two readings."""
        return self.unit or self.nature.unit


def name_fault(name: str) -> str:
    """What is wrong with a channel's name; empty where nothing is."""
    if not _NAME.fullmatch(name):
        return f"{name[:60]!r} is not a name for a channel: lower-case letters, digits and _, beginning with a letter"
    return ""
