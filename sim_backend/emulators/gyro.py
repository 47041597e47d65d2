"""Emulated gyroscopes: the rate of the platform as datagrams of a real device, late as the real one is."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from drivers.codecs import stim300, vectornav
from drivers.codecs.stim300_special import Stim300Configuration, encode_configuration, encode_serial_number
from rig.arrays import Array

AXES = "xyz"
BITS_PER_BYTE = 10  # a start bit, eight, a stop bit


@dataclass(frozen=True)
class GyroSettings:
    """How the emulated device is set up; ``settings`` are those of its driver."""

    sample_rate_hz: float
    baud: int
    axis: str
    invert: bool
    noise_deg_s: float
    bias_deg_s: float
    drift_ppm: float
    start_up_s: float
    seed: int
    settings: Mapping[str, bool | int | float | str | None]


def flat_low_pass(group_delay_s: float, corner_hz: float, step_s: float) -> Array:
    """A symmetric kernel with this delay and -3 dB at the corner, its pass band as flat as the delay allows.

    A Gaussian times (a + b t^2) whose second moment is zero is flat to fourth order, so that the amplitude
    at 29 Hz is right to 1e-4. Where the delay leaves no room for its lobes, a plain Gaussian has to do.
    """
    half = round(group_delay_s / step_s)
    t = step_s * np.arange(-half, half + 1)

    def flat(width_s: float) -> Array:
        g = np.exp(-0.5 * (t / width_s) ** 2)
        m0, m2, m4 = (float(np.sum(g * t**k)) for k in (0, 2, 4))
        return np.asarray(g * (m4 - m2 * t**2) / (m0 * m4 - m2 * m2))

    def plain(width_s: float) -> Array:
        g = np.exp(-0.5 * (t / width_s) ** 2)
        return np.asarray(g / np.sum(g))

    def gain(kernel: Array) -> float:
        return float(np.sum(kernel * np.cos(2.0 * math.pi * corner_hz * t)))

    widest_s = 4.0 * max(half, 1) * step_s
    shape = flat if gain(flat(widest_s)) < math.sqrt(0.5) else plain
    narrow, wide = 0.3 * step_s, widest_s
    for _ in range(60):
        middle = 0.5 * (narrow + wide)
        narrow, wide = (middle, wide) if gain(shape(middle)) > math.sqrt(0.5) else (narrow, middle)
    return shape(0.5 * (narrow + wide))


def _latency_us(number: int) -> int:
    return 506 + number % 2


class Stim300Emulator:
    """Sends what a STIM300 sends, start-up phase included, and answers its requests.

    ``sample(rate)`` returns the datagram for the instant just reached; it leaves the device
    ``latency_s + transmission_s`` later, as they are before the call.
    """

    def __init__(self, config: GyroSettings) -> None:
        s = config.settings
        self._layout = stim300.LAYOUTS[int(s.get("datagram", 0x90) or 0x90)]
        self._line_ending = bool(s.get("line_ending", False))
        self.filter_hz = int(s.get("filter_hz", 262) or 262)
        self._increments = s.get("output") == "incremental_angle"
        self._axis = AXES.index(config.axis)
        self._sign = -1.0 if config.invert else 1.0
        self._config = config
        self._step = round(stim300.INTERNAL_RATE_HZ / config.sample_rate_hz)
        self._counter = 0
        self._sent = 0
        self._rng = np.random.default_rng([config.seed, 402])
        self._noise: list[float] = []
        self.frozen = False
        self.flags = 0
        self._waiting: list[bytes] = []
        length = self._layout.length + 2 * self._line_ending
        self.transmission_s = length * BITS_PER_BYTE / config.baud
        self.group_delay_s = stim300.GROUP_DELAY_S[self.filter_hz]

    @property
    def latency_s(self) -> float:
        """From the next sample to the first bit of its datagram, as that will say."""
        return _latency_us(self._sent + 1) * 1e-6

    def sample(self, rate_rad_s: float) -> bytes:
        """The datagram of this sample, or a special one that was asked for and takes its place."""
        self._counter = (self._counter + self._step) & 0xFF
        self._sent += 1
        if self._waiting:
            return self._waiting.pop(0)
        starting = self._sent < self._config.start_up_s * self._config.sample_rate_hz
        rate = self._sign * math.degrees(rate_rad_s) + self._config.bias_deg_s + self._next_noise()
        value, status = self._word(rate)
        if starting:
            value, status = round(stim300.SATURATION_DEG_S / stim300.RATE_LSB_DEG_S), 0b0100_0000
        status |= self.flags
        gyro = [0, 0, 0]
        gyro[self._axis] = value
        return stim300.encode_datagram(
            stim300.Datagram(
                self._layout.identifier,
                (gyro[0], gyro[1], gyro[2]),
                status,
                self._counter,
                _latency_us(self._sent),
                acceleration_status=status & 0xE0,
                inclination_status=status & 0xE0,
            ),
            self._line_ending,
        )

    def _word(self, rate_deg_s: float) -> tuple[int, int]:
        limit = stim300.SATURATION_DEG_S
        overload = 0b0001_0000 | 1 << self._axis if abs(rate_deg_s) > stim300.FULL_SCALE_DEG_S else 0
        rate_deg_s = max(-limit, min(limit, rate_deg_s))
        if self._increments:
            return round(rate_deg_s / self._config.sample_rate_hz / stim300.INCREMENT_LSB_DEG), overload
        return round(rate_deg_s / stim300.RATE_LSB_DEG_S), overload

    def _next_noise(self) -> float:
        if self.frozen:
            return 0.0
        if not self._noise:
            self._noise = (self._config.noise_deg_s * self._rng.standard_normal(4096)).tolist()
        return self._noise.pop()

    def command(self, data: bytes) -> None:
        """Bytes from the host. A wrong command is not answered, as on the device."""
        for line in data.split(b"\r"):
            if line == b"C":
                self._waiting.append(encode_configuration(self._own_configuration()))
            elif line == b"I":
                self._waiting.append(encode_serial_number("N25580000000402", self._line_ending))
            elif line == b"R":
                self._sent = 0

    def _own_configuration(self) -> Stim300Configuration:
        bauds = {374_400, 460_800, 921_600, 1_843_200}
        return Stim300Configuration(
            revision="-",
            firmware=1,
            sample_rate_hz=int(self._config.sample_rate_hz),
            identifier=self._layout.identifier,
            line_ending=self._line_ending,
            bit_rate=self._config.baud if self._config.baud in bauds else 0,
            gyro_unit="incremental_angle" if self._increments else "angular_rate",
            gyro_filter_hz=(self.filter_hz,) * 3,
            acceleration_range_g=(10, 10, 10),
        )


class VectorNavEmulator:
    """Sends the binary output of a VN-100 with TimeStartup and AngularRate."""

    group_delay_s = 0.0
    filter_hz = 256

    def __init__(self, config: GyroSettings) -> None:
        self._config = config
        self._axis = AXES.index(config.axis)
        self._sign = -1.0 if config.invert else 1.0
        self._sent = 0
        self._rng = np.random.default_rng([config.seed, 100])
        self.frozen = False
        self.flags = 0  # it has no status byte to show them in
        self.latency_s = 300e-6
        self.transmission_s = 30 * BITS_PER_BYTE / config.baud

    def sample(self, rate_rad_s: float) -> bytes:
        """The packet of this sample."""
        self._sent += 1
        sigma = 0.0 if self.frozen else math.radians(self._config.noise_deg_s)
        noise = sigma * float(self._rng.standard_normal())
        rates = [0.0, 0.0, 0.0]
        rates[self._axis] = self._sign * rate_rad_s + math.radians(self._config.bias_deg_s) + noise
        time_ns = round(self._sent / self._config.sample_rate_hz * 1e9)
        return vectornav.encode_binary_rate(time_ns, (rates[0], rates[1], rates[2]))

    def command(self, data: bytes) -> None:
        """Commands are not answered."""


AnyGyro = Stim300Emulator | VectorNavEmulator
GYROS: Mapping[str, Callable[[GyroSettings], AnyGyro]] = {
    "stim300": Stim300Emulator,
    "vectornav": VectorNavEmulator,
}
"""Emulated devices by the name of the driver that reads them."""
