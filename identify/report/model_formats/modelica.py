"""The model as Modelica: J, C, K and the effects that are a function of angle, rate and torque; others as a comment."""

from __future__ import annotations

import re
from collections.abc import Iterator

from identify.report.model_formats.description import DescribedEffect, ModelDescription, Number
from identify.results import UNITS
from identify.wording import SYMBOLS, on_axis, plain

CLASS = "Platform"
# What the expressions of effects are called in Modelica.
WORDS = {
    "angle_rad": "phi", "rate_rad_s": "w", "torque_nm": "tau", "stiffness_nm_rad": "K",
    "fabs": "abs", "fmin": "min", "fmax": "max",
}  # fmt: skip
NAME = re.compile(r"(?<![\w.])[A-Za-z_]\w*")  # no exponent of a number
UNIT = re.compile(r"1|[A-Za-z0-9.]+(/[A-Za-z0-9]+)?")
AT_REST = ("start = 0.0", "fixed = true")


def content(model: ModelDescription) -> str:
    """The text, of plain ASCII."""
    text = "\n".join(_lines(model)) + "\n"
    return text.encode("ascii", "replace").decode()


def _lines(model: ModelDescription) -> Iterator[str]:
    written = [one for one in model.effects if one.term]
    has_friction = any(one.term and one.term.is_friction for one in written)
    yield from (f"// {line}" for line in model.about())
    yield from (line for one in model.effects if not one.term for line in _left_out(one))
    if has_friction:
        yield f"// Dry friction does not hold the platform here: below {model.soft_rate_rad_s:.3g} rad/s it is in"
        yield "// proportion to the rate (soft_rate), so that it is a function of the rate."
    yield f'model {CLASS} "Platform identified by isp-rig"'
    yield from (_parameter(symbol, name, model.terms.get(name)) for name, symbol in SYMBOLS.items() if len(symbol) == 1)
    if has_friction:
        soft = Number(
            "", model.soft_rate_rad_s, on_axis("rad/s", model.axis), "below it friction is in proportion to w"
        )
        yield _parameter("soft_rate", soft.meaning, soft)
    for one in written:
        yield from (_parameter(f"{one.name}_{n.key}", n.meaning, n) for n in one.numbers)
    torque = "" if model.per_inertia else UNITS[model.axis]["torque"]
    yield f'  input Real tau{_modifiers(torque)} "Torque on the shaft";'
    yield f'  output Real phi{_modifiers(on_axis("rad", model.axis), *AT_REST)} "Angle";'
    yield f'  output Real w{_modifiers(on_axis("rad/s", model.axis), *AT_REST)} "Rate";'
    if written:
        yield "protected"
    if has_friction:
        yield '  Real direction "Sign of the rate";'
    yield from (f'  Real tau_{one.name}{_modifiers(torque)} "Resisting torque";' for one in written)
    yield "equation"
    yield "  der(phi) = w;"
    yield f"  J*der(w) = tau - C*w - K*phi{''.join(f' - tau_{one.name}' for one in written)};"
    if has_friction:
        yield "  direction = min(max(w/soft_rate, -1.0), 1.0);"
    yield from (f"  tau_{one.name} = {_expression(one)};" for one in written)
    yield f"end {CLASS};"


def _left_out(one: DescribedEffect) -> Iterator[str]:
    """A comment with all that is needed to add an effect by hand."""
    numbers = ", ".join(f"{n.key} = {float(n.value)!r} {n.unit}" for n in one.numbers)
    yield f"// Not in the equation: {plain(one.name)}, because {one.why_no_term}."
    yield f"//   {' '.join(one.effect.equation.split())} with {numbers or 'no parameter'}"


def _expression(one: DescribedEffect) -> str:
    """The torque of an effect, in the words of Modelica."""
    assert one.term is not None
    words = WORDS | {number.key: f"{one.name}_{number.key}" for number in one.numbers}
    text = NAME.sub(lambda name: words.get(name[0], name[0]), one.term.expression)
    return f"direction*({text})" if one.term.is_friction else text


def _parameter(name: str, meaning: str, number: Number | None) -> str:
    """A line; a term that the model does not have is zero."""
    value, unit = (number.value, number.unit) if number else (0.0, "")
    said = f"{meaning}, 95 %: {number.ci95[0]:.6g} to {number.ci95[1]:.6g}" if number and number.ci95 else meaning
    quoted = said.replace("\\", "/").replace('"', "'")
    return f'  parameter Real {name}{_modifiers(unit)} = {float(value)!r} "{quoted}";'


def _modifiers(unit: str, *others: str) -> str:
    """As ``(unit = "N.m", start = 0.0)``; a unit that Modelica has no way to write is left out."""
    shown = unit.replace("*", ".").replace("^", "")
    given = [f'unit = "{shown}"'] if UNIT.fullmatch(shown) else []
    return f"({', '.join([*given, *others])})" if given or others else ""
