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
    generations: Annotated[int, Field(ge=1, le=100_000)] = 200
    crossover_probability: Probability = 0.7
    mutation_probability: Probability = 0.1
    elitism: bool = True
    shrinking_mutation: bool = True
    restarts: Annotated[int, Field(ge=0, le=1000)] = 5  # repeats at most while J >= J_dec (Eq. 14, Fig. 5)
    search_factor: Annotated[float, Field(gt=1, le=1e6)] = 10.0  # range above and below the declared value
    objective: Literal["white", "plain"] = "white"  # e(k) of Eq. 12 in rate units, or plain equation error


class ReferenceConfig(Section):
    """Known J, C, K, for Max_Error of Eq. 15; the identifier never sees them."""

    inertia_kg_m2: Positive | None = None
    damping_nm_s_rad: Positive | None = None
    stiffness_nm_rad: Positive | None = None


class AcceptConfig(Section):
    """Limits of acceptance for the residual torque that depends on something."""

    torque_percent: Annotated[float, Field(gt=0, le=100)] = 5.0  # of the torque
    inertia_percent: Positive = 2.0  # by which fitting it may change J, C and K
    damping_percent: Positive = 10.0
    stiffness_percent: Positive = 2.0


class IdentifyConfig(Section):
    """How to identify and when to accept."""

    genetic: GeneticConfig = GeneticConfig()
    accept: AcceptConfig = AcceptConfig()
    j_dec: Positive | None = None  # None: from the noise floor
    reference: ReferenceConfig | None = None
    # Further readings of a bench, or of a recording.h5, that may serve as causes.
    channels: Annotated[Mapping[str, ChannelConfig], AfterValidator(check_channels)] = Field(default_factory=dict)
    candidates: tuple[str, ...] | None = None  # None: every effect of the registry
    follow_up: Literal["auto", "ask", "never"] = "ask"
    holdout: Literal["auto"] | Annotated[float, Field(ge=0.05, le=0.5)] = "auto"
    lowpass_hz: Annotated[float, Field(ge=1e-3, le=1e6)] | None = None  # None: chosen from the data
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1

    @field_validator("candidates")
    @classmethod
    def _candidates_exist(cls, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if names:
            check_effect_names(names)
        return names
