"""A set as it will be played: repeats written out, its torque multiplied by what the limits allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from rig.excitation.base import ExcitationSet
from rig.signals import Use


@dataclass(frozen=True)
class PlannedSet:
    """One set of a campaign. ``scale`` multiplies the torque that the configuration asks for."""

    name: str
    excitation: ExcitationSet
    scale: float = 1.0

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self.excitation.duration_s

    @property
    def frequency_hz(self) -> float | None:
        """The frequency where the set is a single sine, else None."""
        return self.excitation.sine_hz

    @property
    def use(self) -> Use:
        """Whether the run serves the fit or is held out."""
        return self.excitation.use

    def torque(self, time_s: Any) -> Any:
        """Torque in N m at seconds since the start of the set; a float or an array of any shape."""
        return self.scale * self.excitation.torque(time_s)

    def scaled(self, factor: float) -> PlannedSet:
        """The same set with its torque multiplied once more."""
        return replace(self, scale=self.scale * factor)


def planned(sets: Sequence[ExcitationSet]) -> tuple[PlannedSet, ...]:
    """The sets in playing order, repeats at other amplitudes behind their original, every name once."""
    plan: list[PlannedSet] = []
    taken: set[str] = set()
    for excitation in sets:
        for scale in (1.0, *excitation.repeat_scales):
            wanted = excitation.title if scale == 1.0 else f"{excitation.title} x{scale:g}"
            name, n = wanted, 2
            while name in taken:
                name, n = f"{wanted} ({n})", n + 1
            taken.add(name)
            plan.append(PlannedSet(name, excitation, scale))
    return tuple(plan)
