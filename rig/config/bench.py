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
    """A gyroscope on a serial port.

    ``device`` names a driver of docs/devices. ``axis`` is the sensitive axis along the shaft, ``invert``
    turns its sign. ``baud`` and ``sample_rate_hz`` are those the device is set to; the driver's own
    defaults hold where they are left out. ``port: null`` is only good with ``--emulate``.
    """

    device: str = "stim300"
    port: PortName | None = None
    baud: Annotated[int, Field(ge=1200, le=12_000_000)] | None = None
    axis: Literal["x", "y", "z"] = "z"
    invert: bool = False
    sample_rate_hz: Annotated[float, Field(ge=10, le=20_000)] | None = None
    settings: Mapping[str, Setting] = Field(default_factory=dict)


class CanConfig(Section):
    """A CAN adapter, by the name python-can knows it under.

    ``slcan_bulk`` is this project's bus for serial (Lawicel, slcan) adapters; ``socketcan``, ``pcan``,
    ``kvaser``, ``vector``, ``gs_usb`` and the others of python-can work by name, what they need beyond
    ``channel`` and ``bitrate`` goes into ``options``. ``tty_baud`` concerns serial adapters only.
    """

    interface: str = "slcan_bulk"
    channel: PortName | None = None
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000
    tty_baud: Annotated[int, Field(ge=1200, le=12_000_000)] = 115_200
    options: Mapping[str, Setting] = Field(default_factory=dict)


class AmplifierConfig(Section):
    """A servo amplifier on CAN.

    ``node`` is its address on the bus. ``watchdog_ms``: after so long without a sign of life of this
    computer the drive itself has to cut the torque. ``gear_ratio`` is shaft torque over motor torque
    (losses included), ``invert`` turns the sign. ``torque_source`` says what is recorded as the torque:
    ``sent`` (what went out and when, held until the next), ``actual`` (what the drive reports), or ``auto``:
    what the drive reports where it stamps that with its own time, else what was sent.
    """

    device: str = "cia402"
    can: CanConfig = CanConfig()
    node: Annotated[int, Field(ge=0, le=127)] = 1
    watchdog_ms: Annotated[int, Field(ge=5, le=5000)] = 100
    gear_ratio: Positive = 1.0
    invert: bool = False
    torque_source: Literal["auto", "sent", "actual"] = "auto"
    settings: Mapping[str, Setting] = Field(default_factory=dict)


class RealTimeConfig(Section):
    """Real-time scheduling of the loop. ``priority: 0`` requests none; what was granted is reported and recorded.

    ``spin_us`` before each deadline are spent polling the clock instead of sleeping.
    """

    priority: Annotated[int, Field(ge=0, le=90)] = 50
    lock_memory: bool = True
    spin_us: Annotated[float, Field(ge=0, le=1000)] = 0.0


class ProbeConfig(Section):
    """The small pulses between arming and the first set (docs/safety.md).

    ``play: false`` omits them. ``torque_nm``: largest torque of a pulse; if absent, 0.3 times the largest torque of
    the campaign. ``inertia_factor``: factor by which the declared inertia may be wrong, up or down.
    """

    play: bool = True
    torque_nm: Positive | None = None
    inertia_factor: Annotated[float, Field(gt=1, le=100)] = 2.0


class InjectedFault(Section):
    """A fault of the emulated devices: it begins ``after_s`` after the drive is enabled and lasts ``lasts_s``.

    ``value`` is the number that some faults need; docs/devices/emulators.md lists them.
    """

    fault: Annotated[str, Field(min_length=1, max_length=80)]
    after_s: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    lasts_s: Annotated[float, Field(gt=0, le=1e6)] = 1e6
    value: float | None = None


class EmulatorConfig(Section):
    """The devices that `rig emulate` and `--emulate` use in place of the real ones.

    The platform, its undeclared effects and the gyro's noise are those of the `simulated` section.
    ``gyro_drift_ppm``, ``drive_drift_ppm``: their clocks against the host's. ``rated_torque_nm`` and
    ``peak_torque_nm``: nameplate of the drive; the command's step is a thousandth of the former.
    ``drive_delay_ms``: from the frame to the torque. ``start_up_s`` of start-up status precede the first
    good gyro sample. ``ports``: pseudo terminals, as other programs can open them, or local sockets, which do
    not stall on a busy machine; where left out, `rig emulate` makes the former and `--emulate` the latter.
    ``faults`` are injected on request.
    """

    gyro_drift_ppm: Annotated[float, Field(ge=-500, le=500)] = 20.0
    drive_drift_ppm: Annotated[float, Field(ge=-500, le=500)] = -30.0
    start_up_s: Annotated[float, Field(ge=0, le=10)] = 0.3
    rated_torque_nm: Positive = 150.0
    peak_torque_nm: Positive = 300.0
    drive_delay_ms: Annotated[float, Field(ge=0, le=20)] = 0.0
    ports: Literal["terminal", "socket"] | None = None
    faults: tuple[InjectedFault, ...] = ()


class BenchConfig(Section):
    """Real devices, or their emulators at wire level.

    ``settle_s`` is how long the gyro's clock is compared with the host's before anything moves. ``probe``: small
    pulses after arming.
    ``raw_capture`` keeps every byte and frame with its time in `raw/` of the results folder. ``replay``
    names such a folder (relative to this yaml): it is played through the same drivers; no device is contacted.
    """

    gyroscope: GyroscopeConfig = GyroscopeConfig()
    amplifier: AmplifierConfig = AmplifierConfig()
    real_time: RealTimeConfig = RealTimeConfig()
    settle_s: Annotated[float, Field(ge=0.2, le=60)] = 3.0
    probe: ProbeConfig = ProbeConfig()
    raw_capture: bool = True
    replay: Annotated[str, Field(min_length=1, max_length=4096)] | None = None
    emulator: EmulatorConfig = EmulatorConfig()

    @model_validator(mode="after")
    def _peak_is_above_rated(self) -> Self:
        if self.emulator.peak_torque_nm < self.emulator.rated_torque_nm:
            raise ValueError("emulator.peak_torque_nm is below emulator.rated_torque_nm: raise it")
        return self
