"""Before playing: what each set can determine, one line each, for `rig check`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from identify.bounds import advice
from identify.bounds.cramer_rao import Information, of_planned, with_delay
from rig.excitation import PlannedSet
from rig.platform import Platform

ASSUMED_NOISE_RAD_S = math.radians(0.05)  # the accuracy of the paper's gyro


def of_planned_campaign(
    platform: Platform, sets: Sequence[PlannedSet], sample_rate_hz: float, noise_rad_s: float | None
) -> list[str]:
    """Lines on every set, on all together, and on an unknown delay.

    Parameters
    ----------
    noise_rad_s
        One standard deviation of a gyro sample; None or 0 assumes 0.05 deg/s and says so.
    """
    if not sets:
        return []
    noise = noise_rad_s or ASSUMED_NOISE_RAD_S
    late = of_planned(with_delay(platform), sets, sample_rate_hz, noise)
    assumed = "" if noise_rad_s else " (assumed: not declared)"
    basis = (
        "expected accuracy (± one standard error at the declared values); gyro noise "
        f"{math.degrees(noise):.3g} deg/s per sample{assumed} at {sample_rate_hz:g} Hz"
    )
    return [basis, *lines_of(late, advice.DELAY_NAME[0] in platform.effects)]


def lines_of(late: Sequence[Information], delay_declared: bool) -> list[str]:
    """Lines on every run, on all together, and on an unknown delay where none is declared."""
    usable = [i for i in late if np.all(np.isfinite(i.matrix))]
    wild = [f"{i.name}: the declared model is unstable; nothing can be predicted" for i in late if i not in usable]
    if not usable:
        return wild
    plain = usable if delay_declared else [i.without(advice.DELAY_NAME) for i in usable]
    lines = [advice.of_set(i, plain) for i in plain]
    if len(plain) > 1 or advice.weak(plain[0]):
        lines.append(advice.of_campaign(plain))
    delay = "" if delay_declared else advice.of_delay(usable)
    return [*wild, *lines, *([f"all sets together: {delay}"] if delay else [])]
