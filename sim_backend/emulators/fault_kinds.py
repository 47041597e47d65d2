"""The faults there are: a class each, and the name under which it is asked for."""

from __future__ import annotations

import random
from typing import Any, Protocol


class Fault:
    """One fault while it lasts. A fault overrides the places at which it takes hold; elsewhere all passes."""

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

    @property
    def drive(self) -> Any:
        """The emulated drive."""
        ...


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
    """Every datagram has one bit turned over."""

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


class AdapterUnplugged(Fault):
    """The CAN adapter is pulled out."""

    def begin(self, bench: Bench, now_s: float) -> None:
        """Once and for all."""
        bench.unplug_adapter()


class AdapterStalls(Fault):
    """The adapter takes no frame and gives none."""

    def to_adapter(self, data: bytes) -> bytes:
        """Swallowed."""
        return b""

    def to_host(self, data: bytes) -> bytes:
        """Kept back for ever."""
        return b""


class BusOff(Fault):
    """The bus is off: the adapter refuses every frame and hears none."""

    def to_adapter(self, data: bytes) -> bytes:
        """A line that is none, for each, which the adapter answers with BEL."""
        return b"?\r" * data.count(b"\r")


class BusDeaf(Fault):
    """Nothing from the drive reaches the host; what the host sends arrives."""

    def to_host(self, data: bytes) -> bytes:
        """Acknowledgements of the adapter only."""
        return b"".join(line + b"\r" for line in data.split(b"\r")[:-1] if line[:1] not in (b"t", b"T"))


class DriveFault(Fault):
    """The drive goes to fault with error code ``value`` (0x4210, too hot, if not given) and says so by EMCY."""

    def begin(self, bench: Bench, now_s: float) -> None:
        """Once."""
        bench.drive.fail(int(self.value or 0x4210), now_s)


class DriveReset(Fault):
    """The drive resets, as after a dip of its supply."""

    def begin(self, bench: Bench, now_s: float) -> None:
        """Once."""
        bench.drive.restart(now_s)


class TorqueRunsAway(Fault):
    """``value`` N m (100 if not given) act whatever is commanded."""

    def torque(self, torque_nm: float) -> float:
        """Beside the command."""
        return torque_nm + (100.0 if self.value is None else self.value)


class TorqueReversed(Fault):
    """The motor turns the wrong way."""

    def torque(self, torque_nm: float) -> float:
        """Turned round."""
        return -torque_nm


FAULTS: dict[str, type[Fault]] = {
    "gyro_unplugged": GyroUnplugged,
    "gyro_silent": GyroSilent,
    "gyro_checksum": GyroChecksum,
    "gyro_dropped": GyroDropped,
    "gyro_repeated": GyroRepeated,
    "gyro_merged": GyroMerged,
    "gyro_garbled": GyroGarbled,
    "gyro_stuck": GyroStuck,
    "gyro_reversed": GyroReversed,
    "gyro_loose": GyroLoose,
    "gyro_jump": GyroJump,
    "gyro_restarts": GyroRestarts,
    "adapter_unplugged": AdapterUnplugged,
    "adapter_stalls": AdapterStalls,
    "bus_off": BusOff,
    "bus_deaf": BusDeaf,
    "drive_fault": DriveFault,
    "drive_reset": DriveReset,
    "torque_runs_away": TorqueRunsAway,
    "torque_reversed": TorqueReversed,
}
"""By the name under which they are asked for."""
