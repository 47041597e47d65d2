"""Limits on readings that only some rigs have: temperature and current of the drive, angle of an encoder."""

from __future__ import annotations

import math

from rig.config.limits import LimitsConfig
from rig.guard.base import Check, Tick, Trip

LONGEST_WITHOUT_S = 0.1  # an encoder may have no reading for so long


class Reading(Check):
    """What a drive says of itself, by the name of its channel."""

    channel, key, unit, what, cure = "", "", "", "", ""

    def look(self, tick: Tick) -> Trip | None:
        """The reading of this tick, where there is one and a limit to it."""
        allowed = getattr(self._limits, self.key)
        if allowed is None or self.channel not in tick.channels:
            return None
        value = abs(tick.channels[self.channel])
        if value <= allowed or math.isnan(value):
            return None
        return self._trip(f"{self.what} (limits.{self.key})", value, allowed, self.unit, tick.now_s, self.cure)


class DriveTemperature(Reading):
    """The hottest spot that the drive reports."""

    channel, key, unit = "drive_temperature_c", "drive_temperature_c", "deg C"
    what, cure = "temperature of the drive", "Let it cool down; lower torque_nm or lengthen excitation.rest_s."


class DriveCurrent(Reading):
    """The motor's current."""

    channel, key, unit = "drive_current_a", "drive_current_a", "A"
    what, cure = "current of the drive", "Lower torque_nm, or check the declared torque constant."


class EncoderTravel(Check):
    """Travel from an encoder, where there is one: an angle that does not drift, from where the campaign began."""

    def __init__(self, limits: LimitsConfig) -> None:
        super().__init__(limits)
        self.origin()

    def origin(self) -> None:
        """The next reading is the angle of rest, for all sets to come."""
        self._rest_rad: float | None = None
        self._heard_s: float | None = None

    def look(self, tick: Tick) -> Trip | None:
        """The reading of this tick. One that is no number says nothing, and that only for so long."""
        angle_rad = tick.channels.get("angle_rad")
        if angle_rad is None:
            return None
        if not math.isfinite(angle_rad):
            return self._check_silence(tick.now_s)
        self._heard_s = tick.now_s
        if self._rest_rad is None:
            self._rest_rad = angle_rad
        travel_deg = abs(math.degrees(angle_rad - self._rest_rad))
        if travel_deg <= self._limits.travel_deg:
            return None
        return self._trip(
            "travel by the encoder (limits.travel_deg)", travel_deg, self._limits.travel_deg, "deg", tick.now_s,
            "Lower torque_nm or excitation.margin; the declared model may be too stiff.",
        )  # fmt: skip

    def _check_silence(self, now_s: float) -> Trip | None:
        if self._heard_s is None:
            self._heard_s = now_s
        silent_s = now_s - self._heard_s
        if silent_s <= LONGEST_WITHOUT_S:
            return None
        return self._trip(
            "no angle from the encoder", 1e3 * silent_s, 1e3 * LONGEST_WITHOUT_S, "ms", now_s,
            "The encoder delivers no numbers: check its cable and supply.",
        )  # fmt: skip


READINGS: tuple[type[Check], ...] = (EncoderTravel, DriveTemperature, DriveCurrent)
