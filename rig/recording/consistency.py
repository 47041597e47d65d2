"""Whether angle, rate and time agree: units, signs, swapped columns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rig.arrays import Array
from rig.errors import RecordingError
from rig.recording.run import Run

# d(angle)/dt over rate -> what that factor usually means, and the cure.
_KNOWN_FACTORS = (
    (180 / np.pi, "the angle is in degrees", "recorded.scale.angle: 0.0174533"),
    (np.pi / 180, "the rate is in degrees per second", "recorded.scale.rate: 0.0174533"),
    (-1.0, "angle and rate have opposite signs", "recorded.scale.rate: -1 or recorded.scale.angle: -1"),
    (1e-3, "the time is in milliseconds", "recorded.scale.time: 0.001"),
    (1e-6, "the time is in microseconds", "recorded.scale.time: 0.000001"),
    (1e3, "the angle is in thousandths", "recorded.scale.angle: 0.001"),
    (np.pi / 30, "the rate is in turns per minute", "recorded.scale.rate: 0.10472"),
    (2 * np.pi, "the rate is in turns per second", "recorded.scale.rate: 6.28319"),
    (1 / (2 * np.pi), "the angle is in turns", "recorded.scale.angle: 6.28319"),
)
# Noise in the integrated rate alone lowers the factor to the square of the correlation: to 0.98 where that is 0.99, to
# 0.81 where it is 0.9. So a deviation of the factor from 1 counts if it is larger than 0.02 and 0.19.
SURE_CORRELATION = 0.99  # both channels show the same motion, delays and noise aside
SURE_DEVIATION = 0.05  # also more than a scale that is merely calibrated badly
LIKELY_CORRELATION = 0.9
LIKELY_DEVIATION = 0.3
# Four samples a second or fewer: no platform with a spring is seen through that.
SLOWEST_STEP_S = 0.25
FASTEST_STEP_S = 1e-6  # a millionth: a thousand times as fast as the fastest platform needs
DAY_S = 86_400.0
EXCEL_DAYS = (20_000.0, 80_000.0)  # how Excel and LibreOffice count the days of the years 1954 to 2119


def angle_over_rate(run: Run) -> tuple[float, float] | None:
    """Factor and correlation of the angle against the integrated rate, trends (a gyro's bias) removed.

    None where one of them is missing or neither moves.
    """
    if run.angle_rad is None or run.rate_rad_s is None:
        return None
    good = run.valid & np.isfinite(run.angle_rad) & np.isfinite(run.rate_rad_s)
    if good.sum() < 10:
        return None
    time_s, angle, rate = run.time_s[good], run.angle_rad[good], run.rate_rad_s[good]
    integral = np.concatenate(([0.0], np.cumsum(np.diff(time_s) * (rate[1:] + rate[:-1]) / 2)))
    measured, expected = _without_trend(time_s, angle), _without_trend(time_s, integral)
    power, cross = expected @ expected, measured @ expected
    norm = np.sqrt(power * (measured @ measured))
    if not norm > 0:
        return None
    return float(cross / power), float(cross / norm)


def _without_trend(time_s: Array, values: Array) -> Array:
    x = (time_s - time_s.mean()) / np.ptp(time_s)
    y = values - values.mean()
    result: Array = y - x * ((x @ y) / (x @ x))
    return result


def check_angle_against_rate(run: Run, path: Path) -> bool:
    """True where angle and rate were seen to agree, False where that cannot be told.

    Raises RecordingError where they disagree by a constant factor or where one is the other's column.
    """
    compared = angle_over_rate(run)
    if compared is None:
        return False
    factor, correlation = compared
    deviation = abs(factor - 1)
    sure = abs(correlation) > SURE_CORRELATION and deviation > SURE_DEVIATION
    likely = abs(correlation) > LIKELY_CORRELATION and deviation > LIKELY_DEVIATION
    if not sure and not likely and abs(correlation) > LIKELY_CORRELATION:
        return True
    if _columns_swapped(run):
        raise RecordingError(
            f"{path}: the columns of angle and rate seem to be swapped: what was read as the angle is the derivative "
            "of what was read as the rate: exchange recorded.columns.angle and recorded.columns.rate"
        )
    if not sure and not likely:
        return False
    meaning, cure = _meaning(factor)
    raise RecordingError(
        f"{path}: angle and rate disagree: the angle changes {factor:.4g} times as fast as the rate says; "
        f"probably {meaning}: set {cure}"
    )


def _columns_swapped(run: Run) -> bool:
    """Whether angle and rate agree, number for number, once each is taken for the other."""
    compared = angle_over_rate(replace(run, angle_rad=run.rate_rad_s, rate_rad_s=run.angle_rad))
    return compared is not None and compared[1] > SURE_CORRELATION and abs(compared[0] - 1) < SURE_DEVIATION


def _meaning(factor: float) -> tuple[str, str]:
    """What a factor between angle and rate probably comes from, and the key that mends it."""
    for known, meaning, cure in _KNOWN_FACTORS:
        if abs(factor / known - 1) < 0.03:
            return meaning, cure
    return "one of them is scaled wrongly", f"recorded.scale.rate: {factor:.4g} if the angle is right"


def usual_step(time: Array) -> float:
    """The median distance of samples, in the unit of the time, shape (n,); lost ones left out."""
    known = time[np.isfinite(time)]
    return float(np.median(np.diff(known))) if len(known) > 1 else 0.0


def is_excel_date(time: Array) -> bool:
    """Whether these numbers, shape (n,), are dates as a spreadsheet counts them, in days.

    As seconds they would be samples of a fraction of a second, taken hundreds of thousands of times a second.
    """
    first, last, step = float(np.nanmin(time)), float(np.nanmax(time)), usual_step(time)
    return (
        EXCEL_DAYS[0] <= first and last <= EXCEL_DAYS[1] and last - first < 1.0 and 0.0 < step * DAY_S < SLOWEST_STEP_S
    )


def check_time_unit(run: Run, path: Path) -> None:
    """Raise RecordingError where samples stand too far apart, or too close, for the time to be in seconds."""
    step = usual_step(run.time_s)
    if is_excel_date(run.time_s):
        raise RecordingError(
            f"{path}: samples are {step:.3g} s apart (median) around {run.time_s[0]:.7g} s: that looks like dates in "
            f"days, as Excel counts them: set recorded.scale.time: {DAY_S:g}; if it is in seconds, set "
            "recorded.scale.time: 1"
        )
    if step < SLOWEST_STEP_S:
        return
    unit, factor = min(
        (("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)),
        key=lambda entry: abs(np.log10(step * entry[1]) + 3),
    )
    raise RecordingError(
        f"{path}: samples are {step:g} s apart (median), too coarse to follow a platform: the time looks like "
        f"{unit}: set recorded.scale.time: {factor:.9f}".rstrip("0")
        + "; if it is in seconds, set recorded.scale.time: 1"
    )
