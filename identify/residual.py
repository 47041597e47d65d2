"""What a model leaves of the data: where the residual lives, and the torque that it amounts to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal


@dataclass(frozen=True)
class Share:
    """Part of the residual's power; ``by_chance`` is what the sensor's noise alone would show in its place at most."""

    share: float
    by_chance: float


@dataclass(frozen=True)
class Harmonics:
    """What of the residual repeats with the excitation; ``odd`` and ``even`` None where its torque has both."""

    repeats: Share
    own: Share | None  # at the frequencies that were played
    odd: Share | None  # at their other odd multiples
    even: Share | None
    orders: Mapping[int, float]  # of single tones: multiple -> share, where it stands out


@dataclass(frozen=True)
class FreeLine:
    """A steady tone in the residual that belongs to no set's excitation."""

    frequency_hz: float
    size: float  # amplitude, in the residual's unit
    runs: int  # that show it


@dataclass(frozen=True)
class Moment:
    """A short part of one run that holds much of the residual's power."""

    run: str
    from_s: float
    to_s: float
    share: float


@dataclass(frozen=True)
class ResidualDiagnosis:
    """Where the residual of one model lives."""

    quantity: Literal["torque", "rate", "angle"]
    unit: str
    over_floor: float | None  # root mean square over that of the noise alone
    harmonics: Harmonics | None  # None where no excitation repeats
    free_lines: tuple[FreeLine, ...]
    direction: Share | None  # what differs with the direction of motion at the same angle
    memory: Share | None  # what the past explains and the present does not
    moments: tuple[Moment, ...] = ()  # that hold most of it, the loudest first; empty where it is spread


GAIN = "gain of the drive"  # what a drive changes as it runs
FROM_RUN_TO_RUN = "from run to run"


@dataclass(frozen=True)
class Dependence:
    """What the torque that is left depends on, as a free-form term beside the model shows it.

    Attributes
    ----------
    on
        "angle", "rate", "direction", "torque", "time", "history" or "frequency" (spectral lines).
    torque_rms
        Root mean square of that part, N m.
    relative
        The same over the torque.
    false_alarm
        How often chance alone would show as much.
    at
        Where the term's shape is shown: rad, rad/s, N m, seconds since the start of the run, or -1 and 1 for the
        two directions. Empty for what depends on the past, which no single number describes, and for lines.
    shape_nm
        The torque there, N m, without the constant and the linear part that J, C and K take up.
    wave_on, wave_hz
        Of what is "angle", "rate" or "torque" times a wave over the time: which, and the wave's frequency.
    changes
        "inertia", "stiffness", "damping", "friction" or "gain of the drive" where one of these, changing with what
        it depends on, gives this torque; "from run to run" where J, C and K fitted to every run by itself give it.
    step_nm
        Of a torque that acts in steps: how far these are apart.
    """

    on: str
    torque_rms: float
    relative: float
    false_alarm: float
    at: tuple[float, ...] = ()
    shape_nm: tuple[float, ...] = ()
    wave_on: str = ""
    wave_hz: float | None = None
    changes: str = ""
    step_nm: float | None = None


@dataclass(frozen=True)
class Disturbance:
    """What is left after the final model, told as a torque.

    Attributes
    ----------
    torque_rms
        Root mean square, the sensor's part taken off, in the unit of the torque.
    relative
        The same over the torque.
    depends_on
        What of it goes with something; the rest is noise, and in the intervals.
    moves_percent
        How far J, C and K move with the free-form terms of what it depends on beside the model.
    moves_without_percent
        How far they differ with and without an effect that is flexible enough to have taken up part of what is left,
        for each that is named and for all together that were taken back ("creep and cogging"); empty where nothing is
        left that depends on something.
    """

    torque_rms: float
    unit: str
    relative: float
    depends_on: tuple[Dependence, ...] = ()
    moves_percent: Mapping[str, float] = field(default_factory=dict)
    moves_without_percent: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def material_percent(self) -> float:
        """The part that goes with something, in percent of the torque."""
        return 100.0 * sum(d.relative**2 for d in self.depends_on) ** 0.5

    def with_free_form(self, curve: Dependence, moves: Mapping[str, float]) -> Disturbance:
        """The same with a curve that the likelihood asks for; of two that go with the same, the larger."""
        same = [d for d in self.depends_on if d.on == curve.on and d.torque_rms > curve.torque_rms]
        terms = dict.fromkeys((*self.moves_percent, *moves))  # in an order: a sentence lists them
        most = {t: max(self.moves_percent.get(t, 0.0), moves.get(t, 0.0)) for t in terms}
        depends = (*(d for d in self.depends_on if d.on != curve.on), *(same or [curve]))
        size = max(self.torque_rms, curve.torque_rms)
        relative = self.relative * size / self.torque_rms if self.torque_rms else curve.relative
        return replace(
            self, torque_rms=size, relative=relative,
            depends_on=tuple(sorted(depends, key=lambda d: -d.torque_rms)),
            moves_percent=most,
        )  # fmt: skip
