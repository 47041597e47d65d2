"""When each requested fault begins and ends."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rig.config.bench import InjectedFault
from rig.errors import ConfigError
from sim_backend.emulators.faults.base import Bench, Fault
from sim_backend.emulators.faults.kinds import FAULTS


@dataclass
class _Planned:
    what: InjectedFault
    begins_s: float


class FaultSchedule:
    """The faults of one bench: those to come, and those that have hold of it.

    Parameters
    ----------
    planned
        As the file asks for them.
    tell
        Called with (time, what happened) when one begins or ends.
    clock
        Seconds of the bench.

    Raises
    ------
    ConfigError
        For a fault that does not exist.
    """

    def __init__(
        self,
        planned: Sequence[InjectedFault],
        tell: Callable[[float, str], None],
        seed: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        for item in planned:
            require_known(item.fault)
        self._waiting = list(planned)
        self._coming: list[_Planned] = []
        self._acting: list[tuple[float, str, Fault]] = []
        self._tell, self._clock = tell, clock
        self._random = random.Random(seed)

    def enabled(self, now_s: float) -> None:
        """The drive was enabled: the file's faults count from here."""
        for item in self._waiting:
            self.plan(item, now_s)
        self._waiting.clear()

    def plan(self, item: InjectedFault, now_s: float) -> None:
        """One more, from now on. Raises ConfigError for a fault that does not exist."""
        require_known(item.fault)
        self._coming.append(_Planned(item, now_s + item.after_s))

    def pass_time(self, bench: Bench, now_s: float) -> None:
        """Begin and end what is due."""
        if not self._coming and not self._acting:
            return
        for planned in [p for p in self._coming if p.begins_s <= now_s]:
            self._coming.remove(planned)
            what = planned.what
            fault = FAULTS[what.fault](what.value, self._random)
            fault.clock = self._clock
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


def require_known(name: str) -> None:
    """Raise ConfigError for a fault that does not exist."""
    if name not in FAULTS:
        raise ConfigError(f"bench.emulator.faults: there is no fault {name!r}; there are {', '.join(FAULTS)}")
