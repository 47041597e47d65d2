"""Faults of the CAN adapter, the bus, the drive and the motor."""

from __future__ import annotations

import random

from drivers.codecs import cia402
from drivers.codecs.cia402 import encode_emergency
from drivers.codecs.lawicel import CanFrame
from sim_backend.emulators.faults.base import Bench, Fault

NMT_STOP, NMT_PRE_OPERATIONAL = 0x02, 0x80
HOST_BEAT_LINE, DRIVE_BEAT_HEAD = b"t77F", b"t7"


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


class AdapterReplugged(AdapterUnplugged):
    """The CAN adapter is pulled out and, when the fault is over, plugged in again."""

    def end(self, bench: Bench, now_s: float) -> None:
        """It comes back as another device: who had it open has to open it anew."""
        bench.replug_adapter()


class BothUnplugged(AdapterUnplugged):
    """Gyro and CAN adapter vanish together, as when their hub is unplugged."""

    def begin(self, bench: Bench, now_s: float) -> None:
        """Once and for all."""
        bench.unplug_gyro()
        bench.unplug_adapter()


class AdapterGarbled(Fault):
    """Random bytes both ways, as from a serial side at another baud rate."""

    def to_adapter(self, data: bytes) -> bytes:
        """As many as there were."""
        return self.random.randbytes(len(data))

    def to_host(self, data: bytes) -> bytes:
        """As many as there were."""
        return self.random.randbytes(len(data))


class AdapterSlow(Fault):
    """What the host sends reaches the bus ``value`` ms later (90 if not given)."""

    def __init__(self, value: float | None, random_bits: random.Random) -> None:
        super().__init__(value, random_bits)
        self._held: list[tuple[float, bytes]] = []

    def to_adapter(self, data: bytes) -> bytes:
        """What has waited long enough."""
        now_s = self.clock()
        self._held.append((now_s, data))
        due_s = now_s - 1e-3 * (90.0 if self.value is None else self.value)
        due = [waiting for at_s, waiting in self._held if at_s <= due_s]
        del self._held[: len(due)]
        return b"".join(due)


class AdapterDrops(Fault):
    """A share ``value`` of the frames that the host sends is lost (a tenth if not given)."""

    def to_adapter(self, data: bytes) -> bytes:
        """Line by line."""
        share = 0.1 if self.value is None else self.value
        *lines, rest = data.split(b"\r")
        return b"".join(line + b"\r" for line in lines if self.random.random() >= share) + rest


class HostBeatLost(Fault):
    """The drive does not get this computer's heartbeat; everything else arrives."""

    def to_adapter(self, data: bytes) -> bytes:
        """Without it."""
        return b"\r".join(line for line in data.split(b"\r") if not line.startswith(HOST_BEAT_LINE))


class DriveBeatLost(Fault):
    """The drive's heartbeat does not come; its other frames do."""

    def to_host(self, data: bytes) -> bytes:
        """Without it."""
        return b"\r".join(line for line in data.split(b"\r") if not line.startswith(DRIVE_BEAT_HEAD))


class DriveCommanded(Fault):
    """The drive gets an NMT command that this computer did not send."""

    command = NMT_STOP

    def begin(self, bench: Bench, now_s: float) -> None:
        """Once."""
        bench.drive.receive(CanFrame(0, bytes([self.command, 0])), now_s)


class DriveStopped(DriveCommanded):
    """Somebody else on the bus sends NMT stop."""


class DrivePreOperational(DriveCommanded):
    """Somebody else on the bus sends NMT pre-operational."""

    command = NMT_PRE_OPERATIONAL


class DriveOff(Fault):
    """The drive disables itself without a message: safe torque off, or loss of its supply."""

    def begin(self, bench: Bench, now_s: float) -> None:
        """Once."""
        write = bytes([0x2B]) + cia402.CONTROLWORD.to_bytes(2, "little") + bytes(5)
        bench.drive.receive(CanFrame(0x600 + getattr(bench.drive, "node", 0), write), now_s)


class DriveEmergency(Fault):
    """The drive sends an emergency message with code ``value`` (0x2310 if not given) and goes on."""

    def __init__(self, value: float | None, random_bits: random.Random) -> None:
        super().__init__(value, random_bits)
        self._line = b""

    def begin(self, bench: Bench, now_s: float) -> None:
        """Once."""
        data = encode_emergency(int(self.value or 0x2310), 0x02)
        node = getattr(bench.drive, "node", 0)
        self._line = f"t{0x80 + node:03X}{len(data)}{data.hex().upper()}\r".encode("ascii")

    def to_host(self, data: bytes) -> bytes:
        """Before whatever comes next."""
        line, self._line = self._line, b""
        return line + data


class TorqueSaturates(Fault):
    """The motor gives ``value`` N m at most (10 if not given), whatever the drive says."""

    def torque(self, torque_nm: float) -> float:
        """Cut."""
        most = 10.0 if self.value is None else self.value
        return max(-most, min(most, torque_nm))


class TorqueDead(Fault):
    """The motor gives nothing while the drive says that it does: a phase that came off."""

    def torque(self, torque_nm: float) -> float:
        """None."""
        return 0.0


class TorqueDoubled(Fault):
    """The motor gives twice what the drive says."""

    def torque(self, torque_nm: float) -> float:
        """Twice."""
        return 2.0 * torque_nm


class TorqueStuck(Fault):
    """The motor goes on giving the torque that it gave when the fault began, as long as any is commanded."""

    def __init__(self, value: float | None, random_bits: random.Random) -> None:
        super().__init__(value, random_bits)
        self._kept: float | None = None

    def torque(self, torque_nm: float) -> float:
        """The first one."""
        self._kept = torque_nm if self._kept is None else self._kept
        return self._kept if torque_nm != 0.0 else 0.0
