"""The two containers that every later step reads: a Run and a Recording of several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from rig.arrays import Array, Mask
from rig.channels import Channel
from rig.signals import TorqueHold, Use

LONGEST_NAME = 200


def printable(name: str) -> str:
    """Names go to terminals, files and the report: what only steers those is no part of a name."""
    return "".join(c if c.isprintable() else "?" for c in name[:LONGEST_NAME])


@dataclass(frozen=True)
class Excerpt:
    """How a recording too long to be identified whole became a run.

    Attributes
    ----------
    samples
        That the file holds, within from_s and to_s.
    factor
        Of the decimation, behind a low-pass; 1 for none.
    begin_s, end_s
        What of it the run is made of.
    start_s
        Where the file begins, or the window of it that was asked for: times in a run count from there.
    whole
        Whether that is all of it.
    """

    samples: int
    factor: int
    begin_s: float
    end_s: float
    start_s: float
    whole: bool


@dataclass(frozen=True)
class Missing:
    """Rows of a file in which a needed column has no value.

    Attributes
    ----------
    before, after
        How many are left out at the beginning and at the end.
    within
        How many between those count as lost.
    quantities
        What has no value there.
    between
        Quantities that stand in rows of their own and are read between them by straight lines.
    instead
        What the file has there in the place of nothing, in words: "-9999 as torque".
    """

    before: int = 0
    after: int = 0
    within: int = 0
    quantities: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    instead: tuple[str, ...] = ()

    @property
    def told(self) -> bool:
        """Whether there is anything to say of it."""
        return bool(self.before or self.after or self.within or self.between)


@dataclass(frozen=True)
class Run:
    """One stretch of motion, played or recorded; all arrays are one-dimensional and read-only by custom.

    Parameters
    ----------
    name
        What people call it ("0.5 Hz", "run01.npz").
    time_s
        Shape (n,), strictly increasing: the instants at which rate and angle were true at the sensor.
    rate_rad_s, angle_rad
        Shape (n,) or None. The measured channels, untouched: not filtered, not differenced by us.
        At least one is present. An angle is an encoder's and absolute.
    valid
        Shape (n,). False where a sample was lost, saturated or flagged by the device; the value there
        may be NaN and is never used.
    torque_time_s, torque_nm
        Shape (m,) or None for free motion. Shaft torque from measured current. The two clocks agree;
        the two grids need not.
    torque_hold
        How the torque runs between its samples: "band_limited" (instantaneous samples of a smooth
        signal) or "zero_order" (each value held until the next).
    use
        "fit", "holdout", or "auto" where the identifier may choose.
    min_rate_rad_s
        Samples slower than this are left out of the fit and of every error.
    added_inertia_kg_m2
        A known inertia that was mounted for this run.
    frequency_hz
        The excitation frequency of a sine set, for the per-set table; None otherwise.
    channels
        Further measured channels by name, each of shape (n,).
    causes
        Those of them that were declared as something that may act on the platform, with what they are; only
        their readings may be missing (NaN) where a sample is valid.
    rate_corner_hz, rate_delay_s
        The gyro's own low-pass where its data sheet gives it: -3 dB corner and group delay. The delay is
        already taken off ``time_s``; the rounding is in ``rate_rad_s`` (see ``rig.dynamics.low_pass``).
    excerpt
        What was made of a recording longer than ``recorded.most_samples``; None for all of it as it is.
    wraps
        How often the angle began anew after a whole turn in the file; in ``angle_rad`` it goes on.
    missing
        What was left out for want of a value; None where nothing was.
    notes
        What else a person has to know of how its file was read, in words.
    """

    name: str
    time_s: Array
    valid: Mask
    rate_rad_s: Array | None = None
    angle_rad: Array | None = None
    torque_time_s: Array | None = None
    torque_nm: Array | None = None
    torque_hold: TorqueHold = "band_limited"
    use: Use = "auto"
    min_rate_rad_s: float = 0.0
    added_inertia_kg_m2: float = 0.0
    frequency_hz: float | None = None
    channels: Mapping[str, Array] = field(default_factory=dict)
    causes: Mapping[str, Channel] = field(default_factory=dict)
    rate_corner_hz: float | None = None
    rate_delay_s: float | None = None
    excerpt: Excerpt | None = None
    wraps: int = 0
    missing: Missing | None = None
    notes: tuple[str, ...] = ()

    @property
    def duration_s(self) -> float:
        """Length of the run in seconds."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def since_start_s(self) -> float:
        """Time from the start of the run to its first sample here: 0 but for an excerpt."""
        return 0.0 if self.excerpt is None else float(self.time_s[0]) - self.excerpt.start_s


@dataclass(frozen=True)
class Recording:
    """All runs of a campaign, with what is needed to read them later.

    Parameters
    ----------
    runs
        In the order they were played.
    axis
        "rotary" or "linear": labels and units only.
    noise
        One standard deviation of the measured channel (rate if present, else angle), or None where it
        has to be estimated from the data.
    info
        Free text about origin: backend, versions, configuration as read. Never read by the identifier.
    """

    runs: tuple[Run, ...]
    axis: Literal["rotary", "linear"] = "rotary"
    noise: float | None = None
    info: Mapping[str, Any] = field(default_factory=dict)
