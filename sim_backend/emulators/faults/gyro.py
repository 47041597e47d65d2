"""Faults of the gyroscope, its line and its seat on the shaft."""

from __future__ import annotations

import random

from sim_backend.emulators.faults.base import Bench, Fault

STIM300_INTEGRITY = 0b1000_0000


class GyroUnplugged(Fault):
    """The gyro's serial adapter is pulled out."""

    def begin(self, bench: Bench, now_s: float) -> None:
        """Once and for all."""
        bench.unplug_gyro()


class GyroSilent(Fault):
    """The gyro sends nothing: no supply, or its cable is cut behind the adapter."""

    def gyro_bytes(self, data: bytes) -> bytes:
        """Nothing."""
        return b""


class GyroChecksum(Fault):
    """Every datagram has one inverted bit."""

    def gyro_bytes(self, data: bytes) -> bytes:
        """One bit, anywhere."""
        at = self.random.randrange(len(data))
        return data[:at] + bytes([data[at] ^ 1 << self.random.randrange(8)]) + data[at + 1 :]


class GyroDropped(Fault):
    """A share ``value`` of the datagrams is lost (a half if not given)."""

    def gyro_bytes(self, data: bytes) -> bytes:
        """All or nothing."""
        return b"" if self.random.random() < (0.5 if self.value is None else self.value) else data


class GyroRepeated(Fault):
    """Every datagram comes twice."""

    def gyro_bytes(self, data: bytes) -> bytes:
        """Twice."""
        return data + data


class GyroMerged(Fault):
    """Datagrams come in bunches of ``value`` (32 if not given), as from an adapter with a latency timer."""

    def __init__(self, value: float | None, random_bits: random.Random) -> None:
        super().__init__(value, random_bits)
        self._held: list[bytes] = []

    def gyro_bytes(self, data: bytes) -> bytes:
        """Nothing until the bunch is full."""
        self._held.append(data)
        if len(self._held) < (self.value or 32):
            return b""
        bunch, self._held = b"".join(self._held), []
        return bunch


class GyroGarbled(Fault):
    """Random bytes, as from a line at another baud rate."""

    def gyro_bytes(self, data: bytes) -> bytes:
        """As many as there were."""
        return self.random.randbytes(len(data))


class GyroStuck(Fault):
    """The sensor goes on reporting the rate that it saw when the fault began; the datagrams stay sound."""

    def begin(self, bench: Bench, now_s: float) -> None:
        """Not even noise."""
        bench.freeze_gyro(True)

    def end(self, bench: Bench, now_s: float) -> None:
        """Alive again."""
        bench.freeze_gyro(False)

    def __init__(self, value: float | None, random_bits: random.Random) -> None:
        super().__init__(value, random_bits)
        self._kept: float | None = None

    def rate(self, rate_rad_s: float) -> float:
        """The first one."""
        self._kept = rate_rad_s if self._kept is None else self._kept
        return self._kept


class GyroReversed(Fault):
    """The rate has the wrong sign."""

    def rate(self, rate_rad_s: float) -> float:
        """Turned round."""
        return -rate_rad_s


class GyroLoose(Fault):
    """The gyro came off the shaft: it senses nothing."""

    def rate(self, rate_rad_s: float) -> float:
        """Rest."""
        return 0.0


class GyroJump(Fault):
    """The rate is off by ``value`` rad/s (20 if not given)."""

    def rate(self, rate_rad_s: float) -> float:
        """Beside the truth."""
        return rate_rad_s + (20.0 if self.value is None else self.value)


class GyroRestarts(Fault):
    """The gyro resets itself: its start-up status precedes the next good sample."""

    def begin(self, bench: Bench, now_s: float) -> None:
        """As after a reset command."""
        bench.command_gyro(b"R\r")


class GyroReplugged(GyroUnplugged):
    """The gyro's serial adapter is pulled out and, when the fault is over, plugged in again."""

    def end(self, bench: Bench, now_s: float) -> None:
        """It comes back as another device: who had it open has to open it anew."""
        bench.replug_gyro()


class GyroDelayed(Fault):
    """Datagrams come late by ``value`` of their number (60 if not given), as from a buffer that fills."""

    def __init__(self, value: float | None, random_bits: random.Random) -> None:
        super().__init__(value, random_bits)
        self._held: list[bytes] = []

    def gyro_bytes(self, data: bytes) -> bytes:
        """The one from so long ago."""
        self._held.append(data)
        return self._held.pop(0) if len(self._held) > (self.value or 60) else b""


class GyroFlagged(Fault):
    """The gyro says in every datagram that its integrity check failed; the checksums are right."""

    def begin(self, bench: Bench, now_s: float) -> None:
        """Set."""
        bench.flag_gyro(STIM300_INTEGRITY)

    def end(self, bench: Bench, now_s: float) -> None:
        """Well again."""
        bench.flag_gyro(0)


class GyroSaturated(Fault):
    """The rate exceeds the full scale."""

    def rate(self, rate_rad_s: float) -> float:
        """Far beyond it."""
        return 1e3


class GyroNoisy(Fault):
    """White noise of ``value`` rad/s (30 if not given) before the gyro's own low-pass: a loose screw, a bad supply."""

    def rate(self, rate_rad_s: float) -> float:
        """Beside the truth."""
        return rate_rad_s + self.random.gauss(0.0, 30.0 if self.value is None else self.value)


class GyroSpikes(Fault):
    """Now and then a shock of ``value`` rad/s (400 if not given) for a tenth of a millisecond."""

    def rate(self, rate_rad_s: float) -> float:
        """One in five hundred."""
        struck = self.random.random() < 0.002
        return rate_rad_s + (400.0 if self.value is None else self.value) * struck


class GyroDrifts(Fault):
    """Its zero wanders by ``value`` rad/s in a second (0.5 if not given)."""

    def __init__(self, value: float | None, random_bits: random.Random) -> None:
        super().__init__(value, random_bits)
        self._steps = 0

    def rate(self, rate_rad_s: float) -> float:
        """Further with every one of ten thousand steps a second."""
        self._steps += 1
        return rate_rad_s + (0.5 if self.value is None else self.value) * 1e-4 * self._steps


class GyroScaled(Fault):
    """It reports ``value`` times the rate (0.3 if not given): another device, or an axis across the shaft."""

    def rate(self, rate_rad_s: float) -> float:
        """In proportion."""
        return rate_rad_s * (0.3 if self.value is None else self.value)
