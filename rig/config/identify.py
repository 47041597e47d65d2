"""The `identify` section: genetic algorithm, acceptance, candidates and follow-up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, field_validator

from rig.config.base import Positive, Probability, Section
from rig.config.channels import ChannelConfig, check_channels
from rig.config.effects import check_effect_names


class GeneticConfig(Section):
    """The genetic algorithm of the paper's section 2.2; the defaults are its first experiment."""

    population: Annotated[int, Field(ge=4, le=100_000)] = 100
    """Number of individuals."""
    generations: Annotated[int, Field(ge=1, le=100_000)] = 200
    """Number of generations."""
    crossover_probability: Probability = 0.7
    """Probability of crossover."""
    mutation_probability: Probability = 0.1
    """Probability of mutation."""
    elitism: bool = True
    """The best individual passes into the next generation unchanged."""
    shrinking_mutation: bool = True
    """Mutations become smaller from generation to generation."""
    restarts: Annotated[int, Field(ge=0, le=1000)] = 5
    """Repeats at most while J >= J_dec (Eq. 14, Fig. 5)."""
    search_factor: Annotated[float, Field(gt=1, le=1e6)] = 10.0
    """The search ranges from the declared value divided by this factor to the value times it."""
    objective: Literal["white", "plain"] = "white"
    """white: e(k) of Eq. 12 in rate units; plain: plain equation error."""


class ReferenceConfig(Section):
    """Known J, C, K, for Max_Error of Eq. 15; the identifier never sees them."""

    inertia_kg_m2: Positive | None = None
    """Known inertia J, kg m^2 (kg on a linear axis)."""
    damping_nm_s_rad: Positive | None = None
    """Known damping C, N m s/rad (N s/m on a linear axis)."""
    stiffness_nm_rad: Positive | None = None
    """Known stiffness K, N m/rad (N/m on a linear axis)."""


class AcceptConfig(Section):
    """Limits of acceptance for the residual torque that depends on something."""

    torque_percent: Annotated[float, Field(gt=0, le=100)] = 5.0
    """Largest residual torque that depends on something, percent of the torque."""
    inertia_percent: Positive = 2.0
    """Percent by which fitting it may change J."""
    damping_percent: Positive = 10.0
    """Percent by which fitting it may change C."""
    stiffness_percent: Positive = 2.0
    """Percent by which fitting it may change K."""


class IdentifyConfig(Section):
    """How to identify and when to accept."""

    genetic: GeneticConfig = GeneticConfig()
    """The genetic algorithm."""
    accept: AcceptConfig = AcceptConfig()
    """When a residual torque that depends on something is small enough."""
    j_dec: Positive | None = None
    """Objective below which a result is accepted (Eq. 14). If left out, it follows from the noise floor, and a result
    is refused only where the genetic search does not reach the minimum of its own objective."""
    reference: ReferenceConfig | None = None
    """Known J, C, K, for Max_Error (Eq. 15); the identifier never sees them."""
    channels: Annotated[Mapping[str, ChannelConfig], AfterValidator(check_channels)] = Field(default_factory=dict)
    """Further readings of a bench, or of a recording.h5, that may serve as causes, by name."""
    candidates: tuple[str, ...] | None = None
    """Effects to try, by name; all known effects if left out."""
    follow_up: Literal["auto", "ask", "never"] = "ask"
    """Whether to play a further excitation that separates effects which the data cannot tell apart."""
    prove: Literal["auto", "ask", "never"] = "never"
    """Whether to play every set again, with and without the torque that cancels the named effects (see rig prove)."""
    holdout: Literal["auto"] | Annotated[float, Field(ge=0.05, le=0.5)] = "auto"
    """Share of the samples held out, or auto."""
    lowpass_hz: Annotated[float, Field(ge=1e-3, le=1e6)] | None = None
    """Cut-off of the low-pass behind the torque figures, Hz; chosen from the data if left out."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    """Seed of the search."""

    @field_validator("candidates")
    @classmethod
    def _candidates_exist(cls, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if names:
            check_effect_names(names)
        return names
