"""A compensation as a C function, a Python class and a table, all with units, limits and the version of the model."""

from __future__ import annotations

from collections.abc import Iterator

from identify.proof.controller import Controller, Term, table_of
from identify.wording import plain

C_FILE, HEADER_FILE, PYTHON_FILE, TABLE_FILE = "compensation.c", "compensation.h", "compensation.py", "compensation.csv"


def files(controller: Controller) -> dict[str, str]:
    """File name -> text."""
    return {
        HEADER_FILE: header_text(controller), C_FILE: c_text(controller), PYTHON_FILE: python_text(controller),
        TABLE_FILE: table_text(controller),
    }  # fmt: skip


def _about(controller: Controller) -> list[str]:
    """What a reader has to know, line by line; plain ASCII."""
    lines = [
        "Torque in N m to add to the command of a drive, so that the platform moves as J, C and K alone would.",
        f"Model {controller.version} (from a hash of its values). Identified up to "
        f"{controller.most_angle_rad:.4g} rad and {controller.most_rate_rad_s:.4g} rad/s;",
        f"beyond, the value at that limit is used. The output is limited to {controller.most_torque_nm:.4g} N m,",
        "and is zero where an input is not finite.",
        "In a closed loop, start with a part of the friction: overcompensation makes the loop oscillate.",
        "angle_rad is measured from the encoder's zero or, with a gyro alone, from the rest angle without torque;",
        "torque_nm is the torque on the shaft.",
    ]
    lines += [f"Included: {', '.join(plain(t.effect) for t in controller.terms)}."]
    lines += [f"Not included: {plain(name)}: {why}." for name, why in controller.left_out.items()]
    return [line.encode("ascii", "replace").decode() for line in lines]


def header_text(controller: Controller) -> str:
    """compensation.h."""
    body = "\n".join(f" * {line}" for line in _about(controller))
    return f"""/*
{body}
 */
#ifndef COMPENSATION_H
#define COMPENSATION_H

#define COMPENSATION_MODEL "{controller.version}"

double compensation_nm(double angle_rad, double rate_rad_s, double torque_nm);

#endif
"""


def c_text(controller: Controller) -> str:
    """compensation.c, C99."""
    return f"""/* See {HEADER_FILE}. */
#include <math.h>

#include "{HEADER_FILE}"

static const double MOST_ANGLE_RAD = {controller.most_angle_rad!r};
static const double MOST_RATE_RAD_S = {controller.most_rate_rad_s!r};
static const double MOST_TORQUE_NM = {controller.most_torque_nm!r};
static const double SOFT_RATE_RAD_S = {controller.soft_rate_rad_s!r};

static double within(double x, double most)
{{
    return fmin(fmax(x, -most), most);
}}

double compensation_nm(double angle_rad, double rate_rad_s, double torque_nm)
{{
    double direction, total = 0.0;

    if (!(isfinite(angle_rad) && isfinite(rate_rad_s) && isfinite(torque_nm)))
        return 0.0;
    angle_rad = within(angle_rad, MOST_ANGLE_RAD);
    rate_rad_s = within(rate_rad_s, MOST_RATE_RAD_S);
    direction = within(rate_rad_s / SOFT_RATE_RAD_S, 1.0);
    (void)angle_rad;
    (void)torque_nm;
    (void)direction;
{"".join(_c_term(term) for term in controller.terms)}
    return within(total, MOST_TORQUE_NM);
}}
"""


def _c_term(term: Term) -> str:
    numbers = "".join(f"        const double {name} = {number!r};\n" for name, number in term.numbers.items())
    factor = "direction * " if term.is_friction else ""
    return f"    {{ /* {plain(term.effect)} */\n{numbers}        total += {factor}({term.expression});\n    }}\n"


def python_text(controller: Controller) -> str:
    """compensation.py: needs nothing but Python."""
    about = "\n    ".join(_about(controller))
    terms = "\n".join(_python_term(term) for term in controller.terms)
    return f'''"""The compensation of model {controller.version}, as a class."""

from math import cos, exp, fabs, isfinite, sin

fmin, fmax = min, max
__all__ = ["Compensation", "cos", "exp", "fabs", "fmax", "fmin", "sin"]


class Compensation:
    """{about}
    """

    MODEL = "{controller.version}"
    MOST_ANGLE_RAD = {controller.most_angle_rad!r}
    MOST_RATE_RAD_S = {controller.most_rate_rad_s!r}
    MOST_TORQUE_NM = {controller.most_torque_nm!r}
    SOFT_RATE_RAD_S = {controller.soft_rate_rad_s!r}

    def torque_nm(self, angle_rad: float, rate_rad_s: float, torque_nm: float = 0.0) -> float:
        """Torque in N m to add, from angle in rad, rate in rad/s and the torque on the shaft in N m."""
        if not (isfinite(angle_rad) and isfinite(rate_rad_s) and isfinite(torque_nm)):
            return 0.0
        angle_rad = min(max(angle_rad, -self.MOST_ANGLE_RAD), self.MOST_ANGLE_RAD)
        rate_rad_s = min(max(rate_rad_s, -self.MOST_RATE_RAD_S), self.MOST_RATE_RAD_S)
        direction = min(max(rate_rad_s / self.SOFT_RATE_RAD_S, -1.0), 1.0)
        total = 0.0
{terms}
        return min(max(total, -self.MOST_TORQUE_NM), self.MOST_TORQUE_NM)
'''


def _python_term(term: Term) -> str:
    numbers = "".join(f"        {name} = {number!r}\n" for name, number in term.numbers.items())
    factor = "direction * " if term.is_friction else ""
    return f"        # {plain(term.effect)}\n{numbers}        total += {factor}({term.expression})"


def table_text(controller: Controller) -> str:
    """compensation.csv: comments, a header, one row a pair of angle and rate; without torque on the shaft."""
    return "\n".join(_table_lines(controller)) + "\n"


def _table_lines(controller: Controller) -> Iterator[str]:
    yield from (f"# {line}" for line in _about(controller))
    yield "angle_rad,rate_rad_s,compensation_nm"
    for angle, rate, torque in table_of(controller):
        yield f"{angle!r},{rate!r},{torque!r}"
