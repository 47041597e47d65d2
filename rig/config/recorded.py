"""The `recorded` section: measurements made elsewhere, their columns and units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, field_validator, model_validator

from rig.config.base import NonNegative, Positive, Section
from rig.config.channels import ChannelConfig, check_channels
from rig.signals import NO_COLUMN

MAX_RUNS = 1000
MOST_SAMPLES = 50_000  # the five sets of ten seconds at 1 kHz of the paper; about 0.9 GiB of memory
ColumnName = Annotated[str, Field(min_length=1, max_length=200)]


def _check_path(file: str) -> str:
    # Whoever wrote the file may read any recording on the machine (`../data/run1.csv` is ordinary), and
    # reading a file as numbers discloses nothing; what is no local path at all is refused here, and what
    # is not a regular file (a pipe that never ends, a device) where it is opened.
    if "://" in file:
        raise ValueError("is an address, not a file: download it first and give the path of the copy")
    if "\0" in file or not file.strip():
        raise ValueError("is not a path: give a file relative to this yaml, or an absolute path")
    return file


class RecordedRun(Section):
    """One file, or one stretch of it."""

    file: Annotated[str, Field(max_length=4096)]
    """Recording, relative to this file or absolute: .csv, .csv.gz, .npz, .mat, .h5, by suffix."""
    use: Literal["auto", "fit", "holdout"] = "auto"
    """fit: for the parameters; holdout: only for selection and error; auto: the program chooses."""
    from_s: float | None = None
    """Start of the interval that is used, in the file's time, s."""
    to_s: float | None = None
    """End of the interval that is used, in the file's time, s."""
    min_rate_rad_s: NonNegative | None = None
    """Slower samples are left out of the error and the fit, rad/s."""
    added_inertia_kg_m2: NonNegative = 0.0
    """Known inertia mounted for this run, kg m^2 (kg on a linear axis)."""

    _path = field_validator("file")(_check_path)

    @model_validator(mode="after")
    def _window_is_not_empty(self) -> Self:
        if self.from_s is not None and self.to_s is not None and self.to_s <= self.from_s:
            raise ValueError(f"to_s = {self.to_s:g} has to be later than from_s = {self.from_s:g}")
        return self


class ChannelColumn(ChannelConfig):
    """A further column that may serve as a cause; ``column`` is the channel's own name where left out."""

    column: ColumnName | None = None
    """Name of the column; the channel's own name if left out."""
    scale: float = 1.0
    """Factor from the file's numbers to the channel's unit."""

    @field_validator("scale")
    @classmethod
    def _not_zero(cls, factor: float) -> float:
        if factor == 0:
            raise ValueError("a factor of 0 sets every value to 0: give the factor that converts to the channel's unit")
        return factor


ChannelColumns = Annotated[Mapping[str, ChannelColumn], AfterValidator(check_channels)]


class Columns(Section):
    """Names of the columns where they are not the default ones, and further columns that may serve as causes."""

    time: ColumnName | None = None
    """Column of the time."""
    torque: ColumnName | None = None
    """Column of the torque; none: a free decay, whatever the file has."""
    rate: ColumnName | None = None
    """Column of the rate; none: it is not read."""
    angle: ColumnName | None = None
    """Column of the angle; none: it is not read."""
    valid: ColumnName | None = None
    """Column that is 0 where a sample was lost."""
    channels: ChannelColumns = Field(default_factory=dict)
    """Further columns that may serve as causes, by the channel's name."""

    @model_validator(mode="after")
    def _each_column_once(self) -> Self:
        given = [name for name in (self.time, self.torque, self.rate, self.angle, self.valid) if name]
        given += [channel.column or name for name, channel in self.channels.items()]
        twice = sorted({name for name in given if given.count(name) > 1 and name != NO_COLUMN})
        if twice:
            raise ValueError(f"column {twice[0]!r} is used for two quantities: each needs its own")
        return self


class Scale(Section):
    """Factors from the file's numbers to s, N m, rad/s and rad."""

    time: Positive = 1.0
    """Factor from the file's numbers to s."""
    torque: float = 1.0
    """Factor to N m (N on a linear axis)."""
    rate: float = 1.0
    """Factor to rad/s (m/s on a linear axis)."""
    angle: float = 1.0
    """Factor to rad (m on a linear axis)."""

    @field_validator("torque", "rate", "angle")
    @classmethod
    def _not_zero(cls, factor: float) -> float:
        if factor == 0:
            raise ValueError(
                "a factor of 0 sets every value to 0: give the factor that converts to SI units, e.g. 0.0174533 from "
                "degrees"
            )
        return factor


class RecordedConfig(Section):
    """The recordings of a campaign that is not played but read."""

    runs: tuple[RecordedRun, ...]
    """The files, one entry a run."""
    columns: Columns = Columns()
    """Names of the columns, where they differ from the default names."""
    scale: Scale = Scale()
    """Factors from the file's numbers to SI units."""
    sample_rate_hz: Annotated[float, Field(gt=0, le=1e9)] | None = None
    """Rows a second (Hz) of a file without a time; they are then evenly spaced from 0 s on."""
    axis: Literal["rotary", "linear"] = "rotary"
    """linear: mass in kg, force in N and position in m instead of kg m^2, N m and rad."""
    torque_hold: Literal["band_limited", "zero_order"] = "band_limited"
    """zero_order: each torque was held until the next sample; band_limited: it varies between samples."""
    noise: Annotated[float, Field(ge=1e-30, le=1e12)] | None = None
    """One standard deviation of the measured channel, in its SI unit; estimated if left out."""
    min_rate_rad_s: NonNegative = 0.0
    """Samples slower than this are left out of the error and the fit, in all runs, rad/s."""
    most_samples: Annotated[int, Field(ge=2_000, le=100_000_000)] = MOST_SAMPLES
    """Longer recordings are low-passed, decimated and, if need be, cut to this many samples in all."""

    @field_validator("runs")
    @classmethod
    def _one_to_a_thousand(cls, runs: tuple[RecordedRun, ...]) -> tuple[RecordedRun, ...]:
        # After the runs themselves, or one wrong run would also be reported as a list that is too short.
        if not 1 <= len(runs) <= MAX_RUNS:
            given = f"a list of {len(runs)}" if runs else "[]"
            raise ValueError(f"{given} is not allowed: has to be at least 1 and at most {MAX_RUNS} runs")
        return runs

    @model_validator(mode="after")
    def _something_to_fit(self) -> Self:
        if all(run.use == "holdout" for run in self.runs):
            raise ValueError("all runs have use: holdout, so there is nothing to fit: set use: fit for at least one")
        return self

    @model_validator(mode="after")
    def _one_time(self) -> Self:
        if self.sample_rate_hz is None:
            return self
        if self.columns.time not in (None, NO_COLUMN):
            raise ValueError("sample_rate_hz and columns.time are both given: keep the column if the file has a time")
        if "time" in self.scale.model_fields_set:
            raise ValueError("sample_rate_hz and scale.time are both given: keep the scale if the file has a time")
        return self

    @property
    def scales_given(self) -> frozenset[str]:
        """The quantities whose factor to SI units the user stated; a sample rate states that of the time."""
        return frozenset(self.scale.model_fields_set | ({"time"} if self.sample_rate_hz is not None else set()))

    def min_rate_of(self, run: RecordedRun) -> float:
        """The run's own threshold, else the one for all runs, in rad/s."""
        return self.min_rate_rad_s if run.min_rate_rad_s is None else run.min_rate_rad_s
