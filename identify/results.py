"""What an identification found: plain values, read by result.json, model.yaml, the summary and the report."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from identify.proven import Proof
from identify.residual import (  # noqa: F401  whoever reads a result finds all of it here
    Dependence,
    Disturbance,
    FreeLine,
    Harmonics,
    Moment,
    ResidualDiagnosis,
    Share,
)
from rig.platform import Platform
from rig.recording.run import Array

UNITS = {
    "rotary": {"inertia": "kg*m^2", "damping": "N*m*s/rad", "stiffness": "N*m/rad", "torque": "N*m", "rate": "rad/s"},
    "linear": {"inertia": "kg", "damping": "N*s/m", "stiffness": "N/m", "torque": "N", "rate": "m/s"},
}

NORMAL_95 = 1.96  # half a 95 % interval in standard errors, where the error is normal


@dataclass(frozen=True)
class ParameterEstimate:
    """A number that the data determine, with its uncertainty."""

    value: float
    std_error: float
    ci95: tuple[float, float]
    unit: str
    max_error_percent: float | None = None  # Eq. 15 against identify.reference

    @classmethod
    def normal(cls, value: float, std_error: float, unit: str) -> ParameterEstimate:
        """With the interval of a normal error."""
        half = NORMAL_95 * std_error
        return cls(value, std_error, (value - half, value + half), unit)


@dataclass(frozen=True)
class NotReported:
    """A parameter that stands in no table, and why."""

    name: str  # "stiffness", or "stribeck_friction.speed"
    reason: str
    as_declared: bool = False  # the model stands there with its declared value, and replays the runs with it


@dataclass(frozen=True)
class Errors:
    """How far a model is from the data; None where it cannot be said (no torque, no held-out samples)."""

    residual_rms_torque: float | None
    holdout_rate_rms: float | None  # free run against the measured rate (angle, for an encoder), held-out samples
    holdout_fit_percent: float | None  # 100 (1 - |error| / |signal - mean|)
    residual_torque_relative: float | None
    holdout_torque_relative: float | None
    lowpass_hz: float | None  # cut-off of the zero-phase low-pass behind the torque figures
    holdout_measure: str = "holdout_rate_rms"  # which held-out figure decided between models


@dataclass(frozen=True)
class ModelResult:
    """One model: the declared one (before) or the one with what was added and dropped (after)."""

    parameters: Mapping[str, ParameterEstimate]
    effect_parameters: Mapping[str, Mapping[str, ParameterEstimate]]
    error: Errors
    dropped: tuple[NotReported, ...] = ()
    not_determined: tuple[NotReported, ...] = ()
    correlation: Mapping[str, float] = field(default_factory=dict)  # "inertia, stiffness" -> -0.98
    # What replays the runs, numbers included that stand in no table; without torque per unit of inertia.
    platform: Platform | None = None


TAKEN_BACK = "added, then no longer needed"  # status of a candidate that stood for a while


@dataclass(frozen=True)
class Candidate:
    """One effect that was tried on the model as it then stood."""

    effect: str
    round: int
    delta_bic: float  # BIC with it minus BIC without: negative is better
    holdout_rate_rms: float | None
    status: str  # "added", "rival", "no better", "not tried further", ...


@dataclass(frozen=True)
class Verdict:
    """What the model lacked."""

    effects: tuple[str, ...]
    confusable_with: Mapping[str, tuple[str, ...]]
    never_separable: Mapping[str, str]  # "actuator_lag / sensor_lag" -> why
    unexplained_fraction: float
    unexplained: bool
    candidates: tuple[Candidate, ...]
    sentences: tuple[str, ...]  # the verdict in words, one finding each
    rival_models: Mapping[str, Mapping[str, Platform]] = field(default_factory=dict)  # effect -> rival -> fitted model
    contribution: Mapping[str, float] = field(default_factory=dict)  # effect -> held-out error without it / with it
    left_open: str = ""  # what was found and may be either of two things, in words
    tells_apart: str = ""  # what would tell which
    explained_fraction: float = 0.0  # of the residual's power above the noise floor, that the final model takes away


@dataclass(frozen=True)
class GeneticRun:
    """How the genetic algorithm went (Eq. 12-14)."""

    name: str  # the set, or "all sets"
    parameters: Mapping[str, float]  # best individual, before any polish
    closed_form: Mapping[str, float]
    gap_percent: Mapping[str, float]  # best individual against the closed form
    objective: float
    j_dec: float
    restarts: int
    accepted: bool
    history: Array  # best objective of every generation of the last repeat
    roulette_only: Mapping[str, float]  # Eq. 13 without elitism
    plain_objective: Mapping[str, float]  # e(k) as plain equation error
    closed_form_objective: float | None = None


@dataclass(frozen=True)
class SetResult:
    """One set (run) fitted for itself with the effects of the final model."""

    name: str
    frequency_hz: float | None
    parameters: Mapping[str, ParameterEstimate]
    objective: float
    restarts: int
    accepted: bool
    identifiable: tuple[str, ...]
    advice: str
    genetic: GeneticRun | None = None


@dataclass(frozen=True)
class RunTraces:
    """What the report draws of one run; all of shape (n,) and thinned nowhere."""

    name: str
    time_s: Array
    measured: Array
    channel: Literal["rate", "angle"]
    keep: Array  # 1.0 where the sample counts
    simulated_before: Array
    simulated_after: Array
    torque_residual_before: Array | None  # N m, behind the low-pass
    torque_residual_after: Array | None
    angle_rad: Array
    rate_rad_s: Array
    torque_nm: Array | None
    holdout: Array  # 1.0 where the sample was held out
    frequency_hz: float | None = None  # of its torque, where that is one tone by plan


@dataclass(frozen=True)
class NoiseFloor:
    """What no model can go below."""

    residual_rms_torque: float | None
    holdout_rate_rms: float
    source: Literal["given", "estimated"]


@dataclass(frozen=True)
class Parting:
    """How far an excitation is expected to part an effect from its rival: chi square that the loser cannot take up."""

    effect: str
    rival: str
    separation: float


@dataclass(frozen=True)
class Unparted:
    """A pair for which no excitation is planned, and why."""

    effect: str
    rival: str
    reason: str


@dataclass(frozen=True)
class Implausible:
    """Fitted numbers that are off from the declared ones by a factor that a wrong unit or sign would make."""

    parameters: tuple[str, ...]
    fitted_over_declared: float
    sentence: str  # with the likely cause


@dataclass(frozen=True)
class FollowUpPlan:
    """The excitation that parts what the data so far cannot."""

    excitation: Mapping[str, Any]  # an `excitation` section as rig.yaml has it
    partings: tuple[Parting, ...]
    duration_s: float  # of torque, rests apart
    why: str


@dataclass(frozen=True)
class FollowUpRound:
    """A follow-up that was played: what it was to part, and what became of each pair."""

    plan: FollowUpPlan
    separated: tuple[tuple[str, str], ...]
    open: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class FollowUp:
    """What to play next, what was played, and what came of it."""

    plan: FollowUpPlan | None
    unparted: tuple[Unparted, ...] = ()
    rounds: tuple[FollowUpRound, ...] = ()
    note: str = ""  # why the plan was not played
    error_without: Errors | None = None  # of the model from before the first follow-up, on all the data


@dataclass(frozen=True)
class Identification:
    """Everything that came out of one recording."""

    accepted: bool
    reasons: tuple[str, ...]  # why not accepted, and what to run next
    axis: Literal["rotary", "linear"]
    before: ModelResult
    verdict: Verdict
    after: ModelResult | None
    noise_floor: NoiseFloor
    per_set: tuple[SetResult, ...]
    joint: GeneticRun | None
    traces: tuple[RunTraces, ...]
    holdout_note: str
    max_error_percent: Mapping[str, float] | None = None  # Eq. 15 over the sets
    aborted: bool = False
    follow_up: FollowUp | None = None  # where a name has a rival
    torque_free: bool = False  # no run has torque: only ratios to the inertia show
    residual_before: ResidualDiagnosis | None = None
    residual_after: ResidualDiagnosis | None = None  # None where nothing was added or dropped
    torque_scale: ParameterEstimate | None = None  # shaft's over recorded; where runs carry a known added inertia
    disturbance: Disturbance | None = None  # None without a torque
    declared: Mapping[str, float] = field(default_factory=dict)  # numbers that somebody gave, by name, in SI units
    plausibility: tuple[Implausible, ...] = ()
    note: str = ""  # why an error in the table grew although the model is better
    proof: Proof | None = None  # where the named effects were cancelled on the rig
    scale_shows: bool = False  # whether runs carry one, so that a scale of the torque is no part of J, C and K
    recorded: bool = False  # the runs were read from files: no `excitation` section whose keys a next step could name

    @property
    def set_scatter(self) -> dict[str, float]:
        """Standard deviation of every parameter from set to set, of those that at least two sets determine."""
        names = {n for one in self.per_set for n in one.parameters}
        values = {n: [s.parameters[n].value for s in self.per_set if n in s.parameters] for n in sorted(names)}
        return {n: statistics.stdev(v) for n, v in values.items() if len(v) > 1}

    @property
    def final(self) -> ModelResult:
        """The model that stands at the end."""
        return self.after or self.before


def follow_up_file_name(rounds: int) -> str:
    """What the plan behind so many played follow-ups is called in the results folder."""
    return "follow_up.yaml" if rounds == 0 else f"follow_up_{rounds + 1}.yaml"
