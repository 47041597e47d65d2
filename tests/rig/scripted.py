"""A rig that does what a test tells it, and remembers what was asked of it."""

from __future__ import annotations

import math
from collections.abc import Callable

from rig.interface import Exchange, GyroSample, Rig, Statement, Torque, TorqueSample
from rig.signals import TorqueHold


class ScriptedRig(Rig):
    """Reports a noisy little rate; ``on_exchange(now_s)`` may raise or return another Exchange."""

    def __init__(
        self,
        on_exchange: Callable[[float], Exchange | None] = lambda now_s: None,
        on_disarm: Callable[[], None] = lambda: None,
    ) -> None:
        self.log: list[str] = []
        self.sent: list[tuple[float, float]] = []
        self.torque_nm = 0.0
        self._on_exchange = on_exchange
        self._on_disarm = on_disarm

    @property
    def torque_hold(self) -> TorqueHold:
        return "zero_order"

    def statement(self) -> Statement:
        return Statement(Torque.SIMULATED, ("a scripted rig",))

    def open(self) -> None:
        self.log.append("open")

    def arm(self) -> None:
        self.log.append("arm")

    def exchange(self, now_s: float, torque_nm: float) -> Exchange:
        reply = self._on_exchange(now_s)
        self.torque_nm = torque_nm
        self.sent.append((now_s, torque_nm))
        rate = 1e-3 * math.sin(1e4 * now_s)
        return reply or Exchange((GyroSample(now_s, rate, True),), (TorqueSample(now_s, torque_nm),))

    def torque_off(self) -> None:
        self.log.append("torque off")
        self.torque_nm = 0.0

    def disarm(self) -> None:
        self.torque_nm = 0.0
        self.log.append("disarm")
        self._on_disarm()

    def close(self) -> None:
        self.log.append("close")
