"""The abstract rig: what the sequencer needs of a bench, real, emulated or simulated.

One tick is one ``exchange``: hand over the torque for this instant, take back whatever the gyro and the
drive have reported since the last one. Every sample carries the time at which it was true (a gyro's
group delay and transport latency are already subtracted by whoever knows them), on the clock of the
sequencer that plays, in seconds. So a backend whose time jumps and a bench with absolute deadlines run
through the same loop, and a sample that arrives ticks later still lands where it belongs.

Life of a rig::

    with rig.opened():          # devices contacted, no torque possible
        with rig.armed():       # drive enabled at zero torque; zero torque and disabled on every way out
            rig.begin_set(set.torque, start_s)
            rig.exchange(now_s, torque_nm) ...
            rig.end_set()
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, Self

from rig.config.bench import ProbeConfig
from rig.signals import TorqueHold

TorqueOfTime = Callable[[Any], Any]  # seconds since the start of the set (float or array) -> N m, same shape
NO_CHANNELS: Mapping[str, float] = {}


class Torque(Enum):
    """What the torque of a rig is made of: said loudly before anything moves."""

    SIMULATED = "SIMULATED"
    EMULATED = "EMULATED"
    REAL = "REAL"


@dataclass(frozen=True)
class Statement:
    """The opening line of a rig: what kind of torque, on which devices."""

    torque: Torque
    devices: tuple[str, ...]

    def __str__(self) -> str:
        return f"Torque is {self.torque.value}: {'; '.join(self.devices)}"


class GyroSample(NamedTuple):
    """One gyro reading; ``valid`` is False where lost, saturated or flagged, and the rate may be NaN."""

    time_s: float
    rate_rad_s: float
    valid: bool


class TorqueSample(NamedTuple):
    """Shaft torque that was really applied, from measured current where the drive reports it.

    With ``torque_hold`` "zero_order" the value holds from ``time_s`` until the next sample.
    """

    time_s: float
    torque_nm: float


StampPoints = tuple[Sequence[float], Sequence[float]]
"""Points of a piecewise straight map from times as they were handed over to better ones; each strictly increasing."""


class Correction(NamedTuple):
    """Better time stamps of the set that began at ``start_s``, known only afterwards.

    ``samples`` are for its gyro samples, ``torque`` for its torque samples; without points nothing is to be changed.
    """

    start_s: float
    samples: StampPoints
    torque: StampPoints


class LowPass(NamedTuple):
    """A gyro's own filter: its -3 dB corner and its group delay, which its samples' times have taken off."""

    corner_hz: float
    delay_s: float


class ExpectedDelay(NamedTuple):
    """By how much torque is expected to act later than its stamp, with what was corrected on the way to that, in words.

    What is fitted beyond it (``torque_delay``) lies where no driver can see.
    """

    delay_s: float
    corrections: tuple[str, ...]


class Exchange(NamedTuple):
    """What came back in one tick, oldest first; either may be empty.

    ``channels`` are further readings of this tick by name with unit (``angle_rad`` of an encoder,
    ``drive_temperature_c``); the same names in every tick of a set.
    """

    gyro: Sequence[GyroSample]
    torque: Sequence[TorqueSample]
    channels: Mapping[str, float] = NO_CHANNELS


class Rig(ABC):
    """A platform with a gyro and a drive. Every method may raise DeviceFault; none blocks for long."""

    @abstractmethod
    def statement(self) -> Statement:
        """What is about to produce torque, for the opening line."""

    @property
    @abstractmethod
    def torque_hold(self) -> TorqueHold:
        """How the torque runs between the torque samples of this rig."""

    @property
    def noise_rad_s(self) -> float | None:
        """One standard deviation of a gyro sample where the gyro's data sheet gives it, else None."""
        return None

    @property
    def rate_low_pass(self) -> LowPass | None:
        """The gyro's own low-pass where its data sheet gives it, else None."""
        return None

    @property
    def expected_delay(self) -> ExpectedDelay | None:
        """What is expected of the stamps of torque and rate; None where nobody can know. Asked for after playing."""
        return None

    @property
    def rate_full_scale_rad_s(self) -> float | None:
        """The largest rate that the gyro can report, known before anything is opened; None for no limit."""
        return None

    @property
    def rate_full_scale_key(self) -> str:
        """The key of the configuration that decides the full scale of the gyro."""
        return "the gyro's full scale"

    @property
    def probe(self) -> ProbeConfig | None:
        """How to probe the platform before the first set; None where no torque can hurt."""
        return None

    @abstractmethod
    def open(self) -> None:
        """Contact all devices; no torque. Raises one DeviceFault that lists everything that failed."""

    @abstractmethod
    def arm(self) -> None:
        """Enable the drive at zero torque, its watchdog running."""

    @abstractmethod
    def exchange(self, now_s: float, torque_nm: float) -> Exchange:
        """Send the torque of this instant; return what arrived since the last call.

        Feeding the drive's watchdog belongs in here and nowhere else: a loop that hangs must look dead.
        """

    @abstractmethod
    def torque_off(self) -> None:
        """Zero torque now, by the shortest road. Safe at any time, twice, and from a signal handler."""

    @abstractmethod
    def disarm(self) -> None:
        """Zero torque, then disable the drive, then verify. Safe when not armed.

        Raises DeviceFault where the drive cannot be shown to be off.
        """

    @abstractmethod
    def close(self) -> None:
        """Let go of all devices. Safe when not open."""

    def begin_set(self, torque: TorqueOfTime, start_s: float) -> None:  # noqa: B027 (most rigs need no hook)
        """Told before the first tick of a set, which takes place at ``start_s``.

        ``torque`` is the excitation as a function of seconds since then. A sampled drive has no use for
        it; an ideal one follows it between the ticks.
        """

    def end_set(self) -> None:  # noqa: B027
        """Told after the last tick of a set, whatever ended it."""

    def corrections(self) -> Sequence[Correction]:
        """Better time stamps of the sets played, asked for when nothing is played any more, open or not.

        A rig whose stamps are final has none.
        """
        return ()

    @contextmanager
    def opened(self) -> Iterator[Self]:
        """Open, and close on every way out."""
        try:
            self.open()
            yield self
        finally:
            self.close()

    @contextmanager
    def armed(self) -> Iterator[Self]:
        """Arm, and disarm on every way out."""
        try:
            self.arm()
            yield self
        finally:
            self.disarm()
