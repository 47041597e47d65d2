"""What the sensors of a recording cannot show: it is not searched for, and set aside where it is declared."""

from __future__ import annotations

from collections.abc import Sequence

from identify.signals.trace import Trace
from rig import effects
from rig.effects.base import Place


def why_unseen(name: str, traces: Sequence[Trace]) -> str:
    """Why no run can show an effect; empty where one may."""
    if name == "rate_bias":
        return "every run of a gyro is given a bias of its own, and an encoder has none"
    if name == "torque_offset" and all(t.biased for t in traces):
        return "behind a gyro alone a constant torque only shifts the angle of rest, which nothing measures"
    if effects.get(name).place is Place.DRIVE and all(t.torque is None for t in traces):
        return "no torque was applied, so that nothing shows what the drive does to one"
    return ""
