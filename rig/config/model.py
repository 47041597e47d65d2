"""The `model` section: what the user declares about the platform, or a model.yaml of an earlier campaign."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

import yaml
from pydantic import AfterValidator, Field, field_validator

from rig.channels import Channel
from rig.config.base import Positive, Section
from rig.config.channels import ModelChannel, check_channels
from rig.config.effects import EffectsConfig
from rig.platform import TERMS, Platform

Term = Literal["inertia", "damping", "stiffness"]


class ModelConfig(Section):
    """J a + C w + K th + effects = M. The defaults are the paper's platform (Tab. 1)."""

    inertia_kg_m2: Positive = 0.02
    """Inertia J, kg m^2 (kg on a linear axis)."""
    damping_nm_s_rad: float = 0.045
    """Damping C, N m s/rad (N s/m on a linear axis)."""
    stiffness_nm_rad: float = 677.3
    """Stiffness K, N m/rad (N/m on a linear axis)."""
    terms: tuple[Term, ...] = TERMS  # type: ignore[assignment]
    """Terms that the platform has; leave out damping or stiffness where there is none."""
    inertia_unknown: bool = False
    """All values are per unit of inertia: identified from a decay without torque."""
    effects_from: tuple[Annotated[str, Field(min_length=1, max_length=4096)], ...] = ()
    """Python files with effects of your own, in this folder or below; their code is run."""
    # Stands before the effects, which are checked against it.
    channels: Annotated[Mapping[str, ModelChannel], AfterValidator(check_channels)] = Field(default_factory=dict)
    """Measured channels that the effects read besides angle, rate and torque, by name."""
    effects: EffectsConfig = Field(default_factory=dict)
    """Effects of the platform beside J, C and K, by name, each with its parameters."""

    @field_validator("terms")
    @classmethod
    def _terms_make_a_model(cls, terms: tuple[Term, ...]) -> tuple[Term, ...]:
        if len(set(terms)) != len(terms):
            raise ValueError("a term is listed twice: name each of inertia, damping, stiffness once")
        if "inertia" not in terms:
            raise ValueError("inertia is required: without it no motion can be simulated; leave out other terms")
        return terms

    @property
    def inertia_declared(self) -> bool:
        """Whether somebody gave the inertia: neither the default, nor the unit of an earlier decay."""
        return "inertia_kg_m2" in self.model_fields_set and not self.inertia_unknown

    @property
    def declared_numbers(self) -> dict[str, float]:
        """What somebody gave, no defaults, in SI units: "inertia", "damping", "stiffness", "effect.parameter"."""
        if self.inertia_unknown:
            return {}
        keys = {"inertia": "inertia_kg_m2", "damping": "damping_nm_s_rad", "stiffness": "stiffness_nm_rad"}
        terms = {t: float(getattr(self, k)) for t, k in keys.items() if k in self.model_fields_set and t in self.terms}
        given = {f"{e}.{p}": float(v) for e, values in self.effects.items() for p, v in values.items()}
        return terms | given

    def platform(self) -> Platform:
        """The declared platform; a term that is left out is zero."""
        return Platform(
            inertia_kg_m2=self.inertia_kg_m2,
            damping_nm_s_rad=self.damping_nm_s_rad if "damping" in self.terms else 0.0,
            stiffness_nm_rad=self.stiffness_nm_rad if "stiffness" in self.terms else 0.0,
            effects=self.effects,
            terms=tuple(t for t in TERMS if t in self.terms),
            channels={name: config.channel(name) for name, config in self.channels.items()},
        )

    @classmethod
    def from_platform(cls, platform: Platform) -> Self:
        """The section that declares ``platform``. Raises ValueError for values outside bounds."""
        return cls(
            inertia_kg_m2=platform.inertia_kg_m2,
            damping_nm_s_rad=platform.damping_nm_s_rad,
            stiffness_nm_rad=platform.stiffness_nm_rad,
            terms=platform.terms,  # type: ignore[arg-type]
            effects=platform.effects,
            channels={c.name: ModelChannel.of(c) for c in channels_of(platform)},
        )


def channels_of(platform: Platform) -> tuple[Channel, ...]:
    """The measured channels that a platform's effects read."""
    if not platform.effects:
        return ()
    from rig import effects  # noqa: PLC0415  compiled kernels: only where there is an effect

    read = [effects.get(name).reads for name in platform.effects]
    return tuple(dict.fromkeys(channel for channel in read if channel is not None))


def model_yaml(platform: Platform, comment: str = "", inertia_unknown: bool = False) -> str:
    """The text of a model.yaml that `model:` of the next campaign takes as a path or pasted.

    Numbers are written with all their digits, parameters under the keys that carry their units. With
    ``inertia_unknown`` the file says of itself that no torque may be planned with it.
    """
    section = ModelConfig.from_platform(platform)
    content = section.model_dump(mode="json", include={"inertia_kg_m2", "damping_nm_s_rad", "stiffness_nm_rad"})
    content["terms"] = list(section.terms)
    if inertia_unknown:
        content["inertia_unknown"] = True
    if platform.effects:
        from rig import effects  # noqa: PLC0415  compiled kernels: only where there is an effect

        files = {str(path): None for name in section.effects if (path := effects.file_of(name))}
        if files:
            content["effects_from"] = list(files)
        if section.channels:
            content["channels"] = {n: c.model_dump(exclude_defaults=True) for n, c in section.channels.items()}
        content["effects"] = {
            name: {p.key: float(section.effects[name][p.name]) for p in effects.get(name).parameters}
            for name in section.effects
        }
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    return head + yaml.safe_dump(content, sort_keys=False, default_flow_style=False)
