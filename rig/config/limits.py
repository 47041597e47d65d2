"""The `limits` section: what no set may exceed in the forecast, and no tick on the bench."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from rig.config.base import Positive, Section


class LimitsConfig(Section):
    """Travel, rate and torque in both directions from rest, and time-outs; the guard trips beyond each of them.

    Where ``standstill_torque_nm`` is left out it is 1.3 times the set's largest torque, but not less than 0.2 nor more
    than 0.4 of ``torque_nm``.
    """

    travel_deg: Positive = 10.0
    """Largest angle to either side of rest, deg."""
    rate_deg_s: Positive = 400.0
    """Largest rate in either direction, deg/s; not above the gyroscope's full scale."""
    torque_nm: Positive = 350.0
    """Largest torque in either direction, N m."""
    stale_gyro_ms: Annotated[float, Field(gt=0, le=1000)] = 20.0
    """Longest time without a valid sample of the gyroscope, ms."""
    frozen_gyro_ms: Annotated[float, Field(gt=0, le=10_000)] | None = 100.0
    """Longest time with bit-identical samples, ms; null for a simulated gyroscope without noise."""
    missed_ticks: Annotated[int, Field(ge=1, le=1000)] = 20
    """Largest number of missed ticks in a row."""
    stall_ms: Annotated[float, Field(gt=0, le=50)] = 50.0
    """Largest lateness of a single tick, ms (a stalled process, or a clock that jumped)."""
    motion_check: bool = True
    """Compares the motion with the torque: jumps, a wrong sign, no motion."""
    standstill_torque_nm: Positive | None = None
    """Largest change of torque without any motion, N m; from the sets if left out."""
    drive_temperature_c: Annotated[float, Field(gt=-50, le=300)] | None = None
    """Highest temperature, deg C, of a drive that reports it."""
    drive_current_a: Positive | None = None
    """Largest current, A, of a drive that reports it."""
