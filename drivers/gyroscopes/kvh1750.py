"""KVH 1750 and 1775 IMU (fibre-optic gyro) on RS-422.

Format A, B or C as configured in the device. The rotation fields are a rate or an angle increment, in
radians or degrees: the device does not say which, so the settings must.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from drivers.codecs import kvh1750 as wire
from drivers.gyroscopes.base import Gyroscope, Reading
from drivers.settings import Settings, read_settings
from rig.config.bench import GyroscopeConfig


class KvhSettings(Settings):
    """As the device is set."""

    rotation: Literal["delta", "rate"] = "delta"
    """As set with =ROTFMT: angle increments or rate."""
    unit: Literal["rad", "deg"] = "rad"
    """As set with =ROTUNITS."""
    filter_delay_ms: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Delay of its filter, ms."""


class Kvh1750(Gyroscope):
    """The driver."""

    label = "KVH 1750"
    settings_model = KvhSettings
    default_baud = 921_600
    default_rate_hz = 1000.0
    count_modulus = wire.SEQUENCE_MODULO
    shortest_sample_bytes = 36  # format A

    def __init__(self, config: GyroscopeConfig) -> None:
        self.settings = read_settings(KvhSettings, config.settings, "bench.gyroscope.settings")
        super().__init__(config, wire.match_kvh)
        scale = 1.0 if self.settings.unit == "rad" else math.pi / 180.0
        self._scale = scale * (self.sample_rate_hz if self.settings.rotation == "delta" else 1.0)

    @property
    def delay_s(self) -> float:
        """As stated, and half a sample where angle increments are sent."""
        return self.settings.filter_delay_ms * 1e-3 + (
            0.5 / self.sample_rate_hz if self.settings.rotation == "delta" else 0.0
        )

    @property
    def full_scale_rad_s(self) -> float:
        """490 deg/s: above it the device sends nothing of use."""
        return math.radians(490.0)

    def decode(self, packet: bytes) -> Reading | None:
        """One message; the status bit of the axis says whether it counts."""
        message = wire.decode_kvh(packet)
        if message is None:
            passed = wire.built_in_test_passed(packet)
            self.messages.append(f"built-in test {'passed' if passed else 'FAILED'}")
            return None
        valid = bool(message.status >> self.axis & 1)
        if not valid:
            self.counts.last_reason = f"status 0x{message.status:02X}: rotation axis not valid"
        return Reading(message.sequence, message.rotation[self.axis] * self._scale, valid)

    def explain_silence(self, raw: bytes) -> str:
        """What to check when nothing decodes."""
        return f"no KVH message at {self.baud} baud: check baud rate and output format (=OUTPUTFMT)"
