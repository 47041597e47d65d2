"""What the axes are called, on a rotary and on a linear axis."""

from __future__ import annotations

from dataclasses import dataclass

from identify.results import RunTraces


@dataclass(frozen=True)
class Quantities:
    """Words and units of one kind of axis."""

    angle: str
    rate: str
    torque: str
    angle_unit: str
    rate_unit: str
    torque_unit: str

    def measured(self, trace: RunTraces) -> tuple[str, str]:
        """Name and unit of the channel that was measured in a run."""
        return (self.rate, self.rate_unit) if trace.channel == "rate" else (self.angle, self.angle_unit)


QUANTITIES = {
    "rotary": Quantities("angle", "rate", "torque", "rad", "rad/s", "N·m"),
    "linear": Quantities("position", "speed", "force", "m", "m/s", "N"),
}


def axis(name: str, unit: str) -> str:
    """An axis title: "rate (rad/s)"."""
    return f"{name} ({unit})"
