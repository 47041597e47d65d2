"""The `limits` section: what no set may exceed in the forecast, and no tick on the bench."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from rig.config.base import Positive, Section


class LimitsConfig(Section):
    """Travel, rate and torque either way from rest, and how long the guard puts up with silence.

    ``stale_gyro_ms``: no valid sample for so long. ``frozen_gyro_ms``: bit-identical samples for so long
    (null switches it off, for a simulated gyro without noise). ``missed_ticks``: so many in a row.
    ``stall_ms``: a single tick later than this, be it a stalled process or a clock that jumped.
    ``motion_check``: whether the motion is held against the torque (jumps, a wrong sign, nothing that moves).
    ``standstill_torque_nm``: the torque may change by so much without any motion; where left out, 1.3 times the
    set's largest torque, but not less than 0.2 nor more than 0.4 of ``torque_nm``.
    ``drive_temperature_c``, ``drive_current_a``: of drives that report them.
    """

    travel_deg: Positive = 10.0
    rate_deg_s: Positive = 400.0
    torque_nm: Positive = 350.0
    stale_gyro_ms: Annotated[float, Field(gt=0, le=1000)] = 20.0
    frozen_gyro_ms: Annotated[float, Field(gt=0, le=10_000)] | None = 100.0
    missed_ticks: Annotated[int, Field(ge=1, le=1000)] = 20
    stall_ms: Annotated[float, Field(gt=0, le=50)] = 50.0
    motion_check: bool = True
    standstill_torque_nm: Positive | None = None
    drive_temperature_c: Annotated[float, Field(gt=-50, le=300)] | None = None
    drive_current_a: Positive | None = None
