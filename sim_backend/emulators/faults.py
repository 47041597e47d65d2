"""Faults on request: what takes hold of an emulated bench, where, and for how long."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from rig.config.bench import InjectedFault
from rig.errors import ConfigError


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


@dataclass
class _Planned:
    what: InjectedFault
    begins_s: float


class Faults:
    """The faults of one bench: those to come, and those that have hold of it.

    Parameters
    ----------
    planned
        As the file asks for them.
    tell
        Called with (time, what happened) when one begins or ends.

    Raises
    ------
    ConfigError
        For a fault that does not exist.
    """

    def __init__(self, planned: Sequence[InjectedFault], tell: Callable[[float, str], None], seed: int = 0) -> None:
        for item in planned:
            known(item.fault)
        self._waiting = list(planned)
        self._coming: list[_Planned] = []
        self._acting: list[tuple[float, str, Fault]] = []
        self._tell = tell
        self._random = random.Random(seed)

    def enabled(self, now_s: float) -> None:
        """The drive was enabled: the file's faults count from here."""
        for item in self._waiting:
            self.plan(item, now_s)
        self._waiting.clear()

    def plan(self, item: InjectedFault, now_s: float) -> None:
        """One more, from now on. Raises ConfigError for a fault that does not exist."""
        known(item.fault)
        self._coming.append(_Planned(item, now_s + item.after_s))

    def pass_time(self, bench: Bench, now_s: float) -> None:
        """Begin and end what is due."""
        if not self._coming and not self._acting:
            return
        for planned in [p for p in self._coming if p.begins_s <= now_s]:
            self._coming.remove(planned)
            what = planned.what
            fault = FAULTS[what.fault](what.value, self._random)
            self._acting.append((planned.begins_s + what.lasts_s, what.fault, fault))
            self._tell(now_s, f"{what.fault} begins")
            fault.begin(bench, now_s)
        for item in [a for a in self._acting if a[0] <= now_s]:
            self._acting.remove(item)
            item[2].end(bench, now_s)
            self._tell(now_s, f"{item[1]} ends")

    def gyro_bytes(self, data: bytes) -> bytes:
        """A datagram as it leaves."""
        for _, _, fault in self._acting:
            data = fault.gyro_bytes(data) if data else data
        return data

    def to_adapter(self, data: bytes) -> bytes:
        """Bytes of the host as they arrive."""
        for _, _, fault in self._acting:
            data = fault.to_adapter(data) if data else data
        return data

    def to_host(self, data: bytes) -> bytes:
        """Bytes of the adapter as they leave."""
        for _, _, fault in self._acting:
            data = fault.to_host(data) if data else data
        return data

    def rate(self, rate_rad_s: float) -> float:
        """What the gyro senses."""
        for _, _, fault in self._acting:
            rate_rad_s = fault.rate(rate_rad_s)
        return rate_rad_s

    def torque(self, torque_nm: float) -> float:
        """What acts on the shaft."""
        for _, _, fault in self._acting:
            torque_nm = fault.torque(torque_nm)
        return torque_nm


def known(name: str) -> None:
    """Raise ConfigError for a fault that does not exist."""
    if name not in FAULTS:
        raise ConfigError(f"bench.emulator.faults: there is no fault {name!r}; there are {', '.join(FAULTS)}")
