"""The interface of a fault: what it may change on an emulated bench."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from typing import Any, Protocol


class Fault:
    """One fault while it lasts. A fault overrides the places at which it takes hold; elsewhere all passes."""

    clock: Callable[[], float] = staticmethod(time.monotonic)
    """Seconds of the emulated bench."""

    def __init__(self, value: float | None, random_bits: random.Random) -> None:
        self.value, self.random = value, random_bits

    def begin(self, bench: Bench, now_s: float) -> None:
        """It takes hold."""

    def end(self, bench: Bench, now_s: float) -> None:
        """It is over."""

    def gyro_bytes(self, data: bytes) -> bytes:
        """One datagram on its way to the host."""
        return data

    def to_adapter(self, data: bytes) -> bytes:
        """Bytes from the host."""
        return data

    def to_host(self, data: bytes) -> bytes:
        """Bytes of the adapter."""
        return data

    def rate(self, rate_rad_s: float) -> float:
        """What the gyro senses."""
        return rate_rad_s

    def torque(self, torque_nm: float) -> float:
        """What acts on the shaft."""
        return torque_nm


class Bench(Protocol):
    """What a fault may do to a bench."""

    def unplug_gyro(self) -> None:
        """Its port vanishes."""
        ...

    def unplug_adapter(self) -> None:
        """Its port vanishes."""
        ...

    def command_gyro(self, data: bytes) -> None:
        """As if the host had sent this to the gyro."""
        ...

    def freeze_gyro(self, frozen: bool) -> None:
        """Take its noise away, or give it back."""
        ...

    def replug_gyro(self) -> None:
        """Plugged in again, under another name."""
        ...

    def replug_adapter(self) -> None:
        """Plugged in again, under another name."""
        ...

    def flag_gyro(self, status: int) -> None:
        """Bits of its status byte that stay set from now on."""
        ...

    @property
    def drive(self) -> Any:
        """The emulated drive."""
        ...
