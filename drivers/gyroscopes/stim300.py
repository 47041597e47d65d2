"""Sensonor STIM300 (datasheet TS1524 rev. 31) on RS-422 or USB.

Normal Mode datagrams carry a counter of the internal 2000 samples a second and the latency from the
sample to the start of transmission; the group delay of the configured low-pass is subtracted here. A
sample counts when its CRC is right and its status byte leaves the axis good.
"""

from __future__ import annotations

import math
from typing import Literal

from drivers.codecs import stim300 as wire
from drivers.codecs import stim300_special as special
from drivers.codecs.framing import StreamFramer
from drivers.gyroscopes.base import Gyroscope, Reading, line_too_slow
from drivers.settings import Settings, read_settings
from rig.config.bench import GyroscopeConfig
from rig.errors import ConfigError
from rig.interface import LowPass

SAMPLE_RATES_HZ = (125.0, 250.0, 500.0, 1000.0, 2000.0)


class Stim300Settings(Settings):
    """As the device is set."""

    datagram: int = 0x90
    """Identifier of the datagram; 0x90: rate only."""
    line_ending: bool = False
    """Datagrams end with carriage return and line feed."""
    filter_hz: Literal[16, 33, 66, 131, 262] = 262
    """Low-pass that the device is set to, Hz."""
    output: Literal["angular_rate", "incremental_angle"] = "angular_rate"
    """Unit of the gyroscope's output."""
    delayed_output: bool = False
    """The output is delayed as the device's manual describes."""


class Stim300(Gyroscope):
    """The driver; ``decode`` is called for every packet whose CRC is right."""

    label = "STIM300"
    settings_model = Stim300Settings
    default_baud = 921_600
    default_rate_hz = 2000.0
    count_modulus = 256
    answers_replace_samples = True

    def __init__(self, config: GyroscopeConfig) -> None:
        self.settings = read_settings(Stim300Settings, config.settings, "bench.gyroscope.settings")
        s = self.settings
        if s.datagram not in wire.LAYOUTS:
            known = ", ".join(f"0x{i:02X}" for i in wire.LAYOUTS)
            raise ConfigError(
                f"bench.gyroscope.settings.datagram: 0x{s.datagram:02X} is not one of the STIM300's: {known}"
            )
        rate_hz = config.sample_rate_hz or self.default_rate_hz
        if rate_hz not in SAMPLE_RATES_HZ:
            raise ConfigError(
                f"bench.gyroscope.sample_rate_hz: {rate_hz:g} is not one of the STIM300's: {SAMPLE_RATES_HZ}"
            )
        self._check_line_carries(s, rate_hz, config.baud or self.default_baud)
        super().__init__(config, wire.datagram_matcher((s.datagram,), s.line_ending))
        scale = wire.RATE_LSB_DEG_S if s.output == "angular_rate" else wire.INCREMENT_LSB_DEG * rate_hz
        self._scale = math.radians(scale)
        self._at = 1 + 3 * self.axis
        self._counter_at = wire.LAYOUTS[s.datagram].bytes_before_crc - 3
        self._good = [wire.axis_is_good(status, config.axis) for status in range(256)]
        self.configuration: special.Stim300Configuration | None = None

    @staticmethod
    def _check_line_carries(s: Stim300Settings, rate_hz: float, baud: int) -> None:
        length = wire.LAYOUTS[s.datagram].length + 2 * s.line_ending
        too_slow = line_too_slow(length, rate_hz, baud)
        if too_slow:
            raise ConfigError(f"{too_slow}: choose datagram 0x90, a lower rate or a faster line")

    @property
    def counts_per_sample(self) -> int:
        """Internal samples between two datagrams."""
        return round(wire.INTERNAL_RATE_HZ / self.sample_rate_hz)

    @property
    def delay_s(self) -> float:
        """Group delay of the filter; an angle increment is the mean rate of the time since the last one."""
        delay = wire.GROUP_DELAY_S[self.settings.filter_hz]
        delay += wire.DELAYED_OUTPUT_S if self.settings.delayed_output else 0.0
        return delay + (0.5 / self.sample_rate_hz if self.settings.output == "incremental_angle" else 0.0)

    @property
    def low_pass(self) -> LowPass:
        """As set; the rest of the delay is no averaging."""
        return LowPass(float(self.settings.filter_hz), wire.GROUP_DELAY_S[self.settings.filter_hz])

    @property
    def full_scale_rad_s(self) -> float:
        """400 deg/s; it goes on to 480, outside of its specification."""
        return math.radians(wire.FULL_SCALE_DEG_S)

    def decode(self, packet: bytes) -> Reading | None:
        """Fast road for data; everything else goes to ``messages``."""
        if packet[0] != self.settings.datagram:
            self._listen(packet)
            return None
        status = packet[10]
        valid = self._good[status]
        if not valid:
            self.counts.last_reason = f"status byte: {wire.status_in_words(status)}"
        at, counter_at = self._at, self._counter_at
        return Reading(
            packet[counter_at],
            int.from_bytes(packet[at : at + 3], "big", signed=True) * self._scale,
            valid,
            int.from_bytes(packet[counter_at + 1 : counter_at + 3], "big") * 1e-6,
        )

    def _listen(self, packet: bytes) -> None:
        identifier = packet[0]
        if identifier in special.CONFIGURATION_IDS:
            self.configuration = special.decode_configuration(packet)
            self.messages.append(f"{self.configuration}")
        elif identifier in special.SERIAL_NUMBER_IDS:
            self.messages.append(f"serial number {special.decode_serial_number(packet)}")
        elif identifier in special.PART_NUMBER_IDS:
            self.messages.append(f"part number {special.decode_part_number(packet)}")
        elif identifier in special.ERROR_IDS:
            self.messages.append(f"errors: {', '.join(special.decode_errors(packet)) or 'none'}")

    def identification_request(self) -> bytes:
        """Ask for the Configuration datagram."""
        return special.REQUESTS["configuration"]

    def objections(self) -> list[str]:
        """Compare the device's own settings with the file's."""
        found, s = self.configuration, self.settings
        if found is None:
            return []
        unit = s.output + ("_delayed" if s.delayed_output else "")
        pairs = [
            ("sample_rate_hz", found.sample_rate_hz, self.sample_rate_hz),
            ("settings.datagram", f"0x{found.identifier:02X}", f"0x{s.datagram:02X}"),
            ("settings.line_ending", found.line_ending, s.line_ending),
            ("settings.output", found.gyro_unit, unit),
            ("settings.filter_hz", found.gyro_filter_hz[self.axis], s.filter_hz),
        ]
        return [
            f"bench.gyroscope.{key} is {wanted}, the device is set to {have}"
            for key, have, wanted in pairs
            if have != wanted
        ]

    def explain_silence(self, raw: bytes) -> str:
        """Why bytes come but no datagram: usually another datagram type is configured."""
        for ending in (True, False):  # without would also fit a stream with line endings
            for identifier in wire.LAYOUTS:
                found = StreamFramer(wire.datagram_matcher((identifier,), ending, special=False)).feed(raw)
                if len(found) >= 3:
                    return (
                        f"the device sends datagram 0x{identifier:02X} {'with' if ending else 'without'} line "
                        f"ending: set bench.gyroscope.settings.datagram: 0x{identifier:02X} and line_ending: "
                        f"{str(ending).lower()}"
                    )
        return f"no STIM300 datagram at {self.baud} baud: check baud rate and wiring (RS-422 pairs)"
