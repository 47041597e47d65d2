"""What the sensors of a recording cannot show: it is not searched for, and set aside where it is declared."""

from __future__ import annotations

from collections.abc import Sequence

from identify.signals.trace import Trace, loads_differ
from rig import effects
from rig.effects.base import Place


def why_unseen(name: str, traces: Sequence[Trace]) -> str:
    """Why no run can show an effect; empty where one may."""
    if name == "rate_bias":
        return "a bias is always fitted to each run of a gyro, and an encoder has none"
    if name == "torque_offset" and all(t.biased for t in traces):
        return "with a gyro alone, a constant torque only shifts the angle of rest, which is not measured"
    if effects.get(name).place is Place.SENSOR and all(t.channel == "angle" and t.beside is None for t in traces):
        return "no gyro was recorded, and an encoder has no low-pass"
    if effects.get(name).place is Place.SENSOR and all(t.torque is None for t in traces):
        return "without torque, a late reading only shifts the motion in time"
    if effects.get(name).place is Place.DRIVE and all(t.torque is None for t in traces):
        return "no torque was applied, so effects of the drive do not show"
    return ""


def can_show(name: str, traces: Sequence[Trace]) -> bool:
    """Whether an effect is worth a search: the sensors can show it, and there is what it needs."""
    return not why_unseen(name, traces) and (not effects.get(name).needs_added_inertia or loads_differ(traces))
