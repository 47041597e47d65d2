"""VectorNav VN-100/VN-200 on a serial line: binary output, or ASCII lines.

Binary output with TimeStartup gives time at the source; ASCII lines carry no time, so there a lost line
shows only as a jump of the clock. Its rate filter is the user's choice: state its delay.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from drivers.codecs import vectornav as wire
from drivers.gyroscopes.base import Gyroscope, Reading
from drivers.settings import Settings, read_settings
from rig.config.bench import GyroscopeConfig


class VectorNavSettings(Settings):
    """As the device is set."""

    filter_delay_ms: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Delay of the rate filter that register 85 is set to, ms."""
    full_scale_deg_s: Annotated[float, Field(gt=0)] = 2000.0
    """Full scale of the rate, deg/s."""


class VectorNav(Gyroscope):
    """The driver, for both kinds of output at once."""

    label = "VectorNav"
    settings_model = VectorNavSettings
    default_baud = 921_600
    default_rate_hz = 400.0
    shortest_sample_bytes = 18  # binary, the rate alone; what the device really sends shows when it is heard

    def __init__(self, config: GyroscopeConfig) -> None:
        self.settings = read_settings(VectorNavSettings, config.settings, "bench.gyroscope.settings")
        super().__init__(config, wire.match_vectornav)

    @property
    def delay_s(self) -> float:
        """As stated in the settings."""
        return self.settings.filter_delay_ms * 1e-3

    @property
    def full_scale_rad_s(self) -> float:
        """2000 deg/s unless stated otherwise."""
        return math.radians(self.settings.full_scale_deg_s)

    def decode(self, packet: bytes) -> Reading | None:
        """A rate from any message that carries one; errors and answers go to ``messages``."""
        message = wire.decode_vectornav(packet)
        if message.error:
            self.messages.append(message.error)
            self.counts.last_reason = message.error
        if message.rate_rad_s is None:
            if not message.error:
                self.messages.append(",".join([message.name, *message.fields]))
            return None
        count = None
        if message.time_startup_ns is not None:
            count = round(message.time_startup_ns * 1e-9 * self.sample_rate_hz)
        return Reading(count, message.rate_rad_s[self.axis], True)

    def identification_request(self) -> bytes:
        """Ask for the model number."""
        return wire.encode_line("RRG", "01")

    def explain_silence(self, raw: bytes) -> str:
        """What to check when nothing decodes."""
        return f"no VectorNav message at {self.baud} baud: check baud rate and that an output with rates is on"
