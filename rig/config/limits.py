"""The `limits` section: what no set may exceed in the forecast, and no tick on the bench."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from rig.config.base import Positive, Section


class LimitsConfig(Section):
    """Travel, rate and torque in both directions from rest, and time-outs; the guard trips beyond each of them.

    ``stale_gyro_ms``: longest time without a valid sample. ``frozen_gyro_ms``: longest time with bit-identical
    samples (null switches it off, for a simulated gyro without noise). ``missed_ticks``: number in a row.
    ``stall_ms``: largest lateness of a single tick (a stalled process or a clock that jumped).
    ``motion_check``: whether the motion is compared with the torque (jumps, a wrong sign, no motion).
    ``standstill_torque_nm``: largest change of torque without any motion; if absent, 1.3 times the
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
