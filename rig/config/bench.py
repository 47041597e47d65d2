"""The `bench` section: which devices stand on the bench, on which ports, and how they are set up.

What every gyroscope or amplifier has is named here; what only one device has goes into its `settings`,
which its driver checks (see docs/devices). So a new device needs no change here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rig.config.base import Positive, Section

Setting = bool | int | float | str | None
PortName = Annotated[str, Field(min_length=1, max_length=256)]


class GyroscopeConfig(Section):
    """A gyroscope on a serial port."""

    device: str = "stim300"
    """Driver of the gyroscope (docs/devices)."""
    port: PortName | None = None
    """Serial port, e.g. /dev/ttyUSB0 or COM3. May be left out only with --emulate."""
    baud: Annotated[int, Field(ge=1200, le=12_000_000)] | None = None
    """Baud rate that the device is set to; the driver's default if left out."""
    axis: Literal["x", "y", "z"] = "z"
    """Sensitive axis along the shaft."""
    invert: bool = False
    """Turns the sign of the rate."""
    sample_rate_hz: Annotated[float, Field(ge=10, le=20_000)] | None = None
    """Sample rate that the device is set to, Hz; the driver's default if left out."""
    settings: Mapping[str, Setting] = Field(default_factory=dict)
    """What only this device has; its page under docs/devices lists the keys."""


class CanConfig(Section):
    """A CAN adapter, by the name python-can knows it under.

    ``slcan_bulk`` is this project's bus for serial (Lawicel, slcan) adapters; ``socketcan``, ``pcan``,
    ``kvaser``, ``vector``, ``gs_usb`` and the others of python-can work by name.
    """

    interface: str = "slcan_bulk"
    """Bus of python-can, e.g. socketcan, pcan, gs_usb; slcan_bulk for serial (slcan) adapters."""
    channel: PortName | None = None
    """Port or channel of the adapter, e.g. /dev/ttyACM0, COM4, can0. May be left out only with --emulate."""
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000
    """Bit rate of the CAN bus, bit/s."""
    tty_baud: Annotated[int, Field(ge=1200, le=12_000_000)] = 115_200
    """Baud rate of a serial adapter; other adapters ignore it."""
    options: Mapping[str, Setting] = Field(default_factory=dict)
    """What the adapter needs beyond channel and bitrate, passed to python-can."""


class AmplifierConfig(Section):
    """A servo amplifier on CAN.

    ``torque_source`` says what is recorded as the torque: ``sent`` (what went out and when, held until the next),
    ``actual`` (what the drive reports), or ``auto``: what the drive reports where it stamps that with its own time,
    else what was sent.
    """

    device: str = "cia402"
    """Driver of the amplifier (docs/devices)."""
    can: CanConfig = CanConfig()
    """The CAN adapter."""
    node: Annotated[int, Field(ge=0, le=127)] = 1
    """Address of the drive on the CAN bus."""
    watchdog_ms: Annotated[int, Field(ge=5, le=5000)] = 100
    """The drive switches the torque off by itself if it hears nothing from this computer for this long, ms."""
    gear_ratio: Positive = 1.0
    """Shaft torque over motor torque, losses included."""
    invert: bool = False
    """Turns the sign of the torque."""
    torque_source: Literal["auto", "sent", "actual"] = "auto"
    """What is recorded as the torque: sent, actual (reported by the drive), or auto."""
    settings: Mapping[str, Setting] = Field(default_factory=dict)
    """What only this device has; its page under docs/devices lists the keys."""


class RealTimeConfig(Section):
    """Real-time scheduling of the loop; what was granted is reported and recorded."""

    priority: Annotated[int, Field(ge=0, le=90)] = 50
    """Real-time priority of the loop; 0 requests none."""
    lock_memory: bool = True
    """Keeps the process in memory, so that no page fault delays a tick."""
    spin_us: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """Time before each deadline spent polling the clock instead of sleeping, us."""


class ProbeConfig(Section):
    """The small pulses between arming and the first set (docs/safety.md)."""

    play: bool = True
    """false omits the pulses."""
    torque_nm: Positive | None = None
    """Largest torque of a pulse, N m; if absent, 0.3 times the largest torque of the campaign."""
    inertia_factor: Annotated[float, Field(gt=1, le=100)] = 2.0
    """Factor by which the declared inertia may be wrong, up or down."""


class InjectedFault(Section):
    """A fault of the emulated devices; docs/devices/emulators.md lists them."""

    fault: Annotated[str, Field(min_length=1, max_length=80)]
    """Name of the fault (docs/devices/emulators.md)."""
    after_s: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """Time from enabling the drive to the start of the fault, s."""
    lasts_s: Annotated[float, Field(gt=0, le=1e6)] = 1e6
    """Duration of the fault, s."""
    value: float | None = None
    """The number that some faults need."""


class EmulatorConfig(Section):
    """The devices that `rig emulate` and `--emulate` use in place of the real ones.

    The platform, its undeclared effects and the gyro's noise are those of the `simulated` section. ``ports`` are
    pseudo terminals, as other programs can open them, or local sockets, which do not stall on a busy machine;
    where left out, `rig emulate` makes the former and `--emulate` the latter. ``clock`` in_step gives bench and
    emulators a time of their own, which passes as fast as both get on: no tick is late because this computer is.
    """

    gyro_drift_ppm: Annotated[float, Field(ge=-500, le=500)] = 20.0
    """Drift of the gyroscope's clock against the host's, ppm."""
    drive_drift_ppm: Annotated[float, Field(ge=-500, le=500)] = -30.0
    """Drift of the drive's clock against the host's, ppm."""
    start_up_s: Annotated[float, Field(ge=0, le=10)] = 0.3
    """Time of start-up status before the first good sample of the gyroscope, s."""
    rated_torque_nm: Positive = 150.0
    """Rated torque on the drive's nameplate, N m; the command's step is a thousandth of it."""
    peak_torque_nm: Positive = 300.0
    """Peak torque on the drive's nameplate, N m; at least the rated torque."""
    drive_delay_ms: Annotated[float, Field(ge=0, le=20)] = 0.0
    """Delay from the CAN frame to the torque, ms."""
    ports: Literal["terminal", "socket"] | None = None
    """terminal: pseudo terminals; socket: local sockets, which do not stall on a busy machine."""
    clock: Literal["real", "in_step"] = "real"
    """real: that of this computer; in_step: one that bench and emulated devices share, so that no tick is late."""
    faults: tuple[InjectedFault, ...] = ()
    """Faults to inject."""

    @model_validator(mode="after")
    def _in_step_on_sockets(self) -> Self:
        if self.clock == "in_step" and self.ports == "terminal":
            raise ValueError("clock: in_step needs ports: socket: nobody can tell what a pseudo terminal has passed on")
        return self


class BenchConfig(Section):
    """Real devices, or their emulators at wire level."""

    gyroscope: GyroscopeConfig = GyroscopeConfig()
    """The gyroscope and its serial port."""
    amplifier: AmplifierConfig = AmplifierConfig()
    """The servo amplifier and its CAN bus."""
    real_time: RealTimeConfig = RealTimeConfig()
    """Real-time scheduling of the loop."""
    settle_s: Annotated[float, Field(ge=0.2, le=60)] = 3.0
    """How long the gyroscope's clock is compared with the host's before anything moves, s."""
    probe: ProbeConfig = ProbeConfig()
    """Small pulses after arming, which check sign and size of the motion."""
    raw_capture: bool = True
    """Keeps every byte and frame with its time in raw/ of the results folder."""
    replay: Annotated[str, Field(min_length=1, max_length=4096)] | None = None
    """Folder of an earlier raw capture, relative to this file, played instead of the devices."""
    emulator: EmulatorConfig = EmulatorConfig()
    """The emulated devices of `rig emulate` and --emulate."""

    @model_validator(mode="after")
    def _peak_is_above_rated(self) -> Self:
        if self.emulator.peak_torque_nm < self.emulator.rated_torque_nm:
            raise ValueError("emulator.peak_torque_nm is below emulator.rated_torque_nm: raise it")
        return self
