"""An identified model as every format writes it: J, C, K and the effects with numbers, intervals, units, equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from identify.model.parameters import with_inertia
from identify.proof.controller import Term, soft_rate_of, term_of, version_of
from identify.results import UNITS, Identification, ParameterEstimate
from identify.wording import SYMBOLS, on_axis
from rig import effects
from rig.config.model import model_yaml
from rig.effects.base import Effect, Parameter, Place
from rig.errors import InputError
from rig.platform import Platform
from rig.recording.run import Recording

EQUATION = "J*a + C*w + K*th + effects = M"
SAME_NUMBER = 1e-9  # relative: an interval is written beside the number that it was found for, and beside no other
_KEYS = {"inertia": "inertia_kg_m2", "damping": "damping_nm_s_rad", "stiffness": "stiffness_nm_rad"}


@dataclass(frozen=True)
class Number:
    """One number of the model. ``std_error`` and ``ci95`` are None where the data do not determine it."""

    key: str  # as in model.yaml, with its unit on a rotary axis
    value: float
    unit: str  # as result.json has it, for the axis that was identified
    meaning: str
    std_error: float | None = None
    ci95: tuple[float, float] | None = None


@dataclass(frozen=True)
class DescribedEffect:
    """One effect of the model; ``term`` is its torque as an expression, None where ``why_no_term`` says why."""

    effect: Effect
    name: str
    numbers: tuple[Number, ...]
    term: Term | None
    why_no_term: str


@dataclass(frozen=True)
class ModelDescription:
    """A model and what stands behind its numbers.

    Attributes
    ----------
    terms
        J, C and K by the names of result.json, as far as the model has them.
    per_inertia
        No torque was recorded and no inertia declared: all torques are over the inertia.
    soft_rate_rad_s
        The rate below which the recording does not tell the direction.
    version
        Of the model: the first digits of the SHA-256 of its values as a model.yaml has them.
    """

    platform: Platform
    axis: str
    terms: Mapping[str, Number]
    effects: tuple[DescribedEffect, ...]
    accepted: bool
    reasons: tuple[str, ...]
    per_inertia: bool
    soft_rate_rad_s: float
    version: str

    @property
    def section(self) -> str:
        """The text of the `model:` section of a rig.yaml that declares it."""
        return model_yaml(self.platform, inertia_unknown=self.per_inertia)

    def about(self) -> tuple[str, ...]:
        """What whoever uses the model has to know, one sentence each."""
        lines = [f"Model {self.version}, identified by isp-rig: {EQUATION}."]
        lines += [] if self.accepted else [f"NOT ACCEPTED: {' '.join(self.reasons)}"]
        if self.per_inertia:
            lines.append("Only ratios to the inertia are known: every torque here is one over the inertia.")
        lines.append(
            "The angle counts from the encoder's zero or, with a gyro alone, from the rest angle without torque."
        )
        return tuple(" ".join(line.split()) for line in lines)


def described(found: Identification, recording: Recording, inertia_kg_m2: float | None = None) -> ModelDescription:
    """The final model of an identification.

    Parameters
    ----------
    inertia_kg_m2
        The declared one, which sets the scale of a recording without torque; None where nobody declared it.

    Raises
    ------
    InputError
        Where no model came out, or one of numbers that no platform has.
    """
    platform = found.final.platform
    if platform is None:
        raise InputError("no model could be identified from these data: read the reasons and record what they ask for")
    per_inertia = found.torque_free and inertia_kg_m2 is None
    if found.torque_free and inertia_kg_m2 is not None:
        platform = with_inertia(platform, inertia_kg_m2)
    try:
        version = version_of(platform)
    except ValueError:  # what no configuration may declare: an inertia that is not positive
        numbers = ", ".join(f"{SYMBOLS[name]} = {getattr(platform, _KEYS[name]):.4g}" for name in platform.terms)
        raise InputError(
            f"no platform has the identified numbers ({numbers}): read the reasons in report.html"
        ) from None
    units = {name: _over_inertia(text, per_inertia, name) for name, text in UNITS[found.axis].items()}
    terms = {
        name: _number(
            _KEYS[name],
            getattr(platform, _KEYS[name]),
            on_axis(units[name], found.axis),
            SYMBOLS[name],
            found.final.parameters.get(name),
        )
        for name in platform.terms
    }
    return ModelDescription(
        platform, found.axis, terms, tuple(_effect(found, platform, name, per_inertia) for name in platform.effects),
        found.accepted, found.reasons, per_inertia, soft_rate_of(recording), version,
    )  # fmt: skip


def _over_inertia(unit: str, per_inertia: bool, name: str = "") -> str:
    if not per_inertia:
        return unit
    return "1" if name == "inertia" else f"{unit}/(kg*m^2)"


def _effect(found: Identification, platform: Platform, name: str, per_inertia: bool) -> DescribedEffect:
    effect, first = effects.get(name), effects.first_of(name)
    estimates = found.final.effect_parameters.get(first, {})
    behind = "" if first == name else f"_{name.removeprefix(first + '_')}"  # as the tables call further orders

    def number(parameter: Parameter, value: float) -> Number:
        unit = _over_inertia(parameter.unit, per_inertia and effect.per_inertia(parameter))
        estimate = estimates.get(f"{parameter.name}{'_run_1' if parameter.per_run else ''}{behind}")
        return _number(parameter.key, value, on_axis(unit, found.axis), parameter.meaning, estimate)

    values = effect.values(platform.effects[name])
    numbers = tuple(number(p, v) for p, v in zip(effect.parameters, values, strict=True))
    term = term_of(platform, name)
    return DescribedEffect(effect, name, numbers, term, "" if term else _why_no_term(effect))


def _number(key: str, value: float, unit: str, meaning: str, estimate: ParameterEstimate | None) -> Number:
    if estimate is None or abs(estimate.value - value) > SAME_NUMBER * abs(value):
        return Number(key, value, unit, meaning)
    return Number(key, value, unit, meaning, estimate.std_error, estimate.ci95)


def _why_no_term(effect: Effect) -> str:
    """Why an effect is no function of angle, rate and torque on the shaft."""
    if effect.place is Place.DRIVE:
        return "it acts on the torque before that reaches the shaft"
    if effect.place is Place.SENSOR:
        return "it changes the measurement, not the motion"
    if effect.reads is not None:
        return "it depends on a measured channel"
    if effect.states:
        return "it has memory: its torque depends on past motion"
    if effects.file_of(effect.name) is not None:
        return "its file gives no formula: Effect(formula=...), as docs/effects/your-own.md has it"
    return effect.stays or "it depends on the time"
