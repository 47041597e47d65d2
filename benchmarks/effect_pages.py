"""The pages of docs/effects, one an effect, made from the effect objects themselves.

python -m benchmarks.effect_pages
"""

from __future__ import annotations

import argparse
import math
from ctypes import c_double
from pathlib import Path

import numpy as np

from benchmarks.line_chart import Line, panel, svg
from rig import effects
from rig.arrays import Array
from rig.dynamics.filters import run_filter
from rig.dynamics.native import addresses
from rig.effects import Effect, Parameter, Place

FOLDER = Path(__file__).parents[1] / "docs" / "effects"
JCK = (0.02, 0.045, 677.3)  # the paper's platform
SIZES: dict[str, dict[str, float]] = {  # what the pictures draw: large enough to be seen
    "coulomb_friction": {"level": 1.2},
    "stribeck_friction": {"coulomb": 1.2, "static": 2.4, "speed": 0.5},
    "presliding_friction": {"level": 1.0, "displacement": 0.02},
    "load_dependent_friction": {"factor": 0.02},
    "quadratic_damping": {"factor": 0.05},
    "directional_damping": {"step": 0.3},
    "cubic_stiffness": {"factor": 3000.0},
    "quadratic_stiffness": {"factor": 300.0},
    "bilinear_stiffness": {"step": 15.0},
    "backlash": {"half_gap": 0.03},
    "hysteresis": {"level": 1.0, "yield_angle": 0.05, "exponent": 1.5, "share": 0.5},
    "creep": {"stiffness": 100.0, "time": 0.2},
    "stiffness_drift": {"slope": 20.0},
    "unbalance": {"sine": 3.0, "cosine": 5.0},
    "cogging": {"sine": 0.6, "cosine": 0.5, "order": 60.0},
    "torque_delay": {"delay": 0.03},
    "actuator_lag": {"time": 0.03},
    "torque_saturation": {"limit": 70.0},
    "torque_deadzone": {"width": 20.0},
    "torque_scale": {"scale": 1.1},
    "torque_offset": {"level": 1.0},
    "flexible_mode": {"inertia": 0.0005, "frequency": 6.0, "ratio": 0.1},
    "sensor_lag": {"time": 0.03},
    "rate_bias": {"bias": 1.0},
    "periodic_disturbance": {"sine": 0.5, "cosine": 0.3, "frequency": 3.37},
}
OVER_RATE = ("coulomb_friction", "stribeck_friction", "quadratic_damping", "directional_damping")
OVER_TIME = ("periodic_disturbance", "flexible_mode")
TIME: Array = np.arange(2001) * 1e-3
ANGLE: Array = 0.16 * np.sin(2 * np.pi * TIME)
RATE: Array = 0.16 * 2 * np.pi * np.cos(2 * np.pi * TIME)
TORQUE: Array = 100.0 * np.sin(2 * np.pi * TIME)


def series(effect: Effect) -> tuple[str, str, list[Line]]:
    """Labels of both axes and the lines of the picture: label, x, y."""
    values = effect.values(SIZES[effect.name])
    if effect.place in (Place.DRIVE, Place.SENSOR):
        sensor = effect.place is Place.SENSOR
        before = RATE if sensor else TORQUE
        after = _filtered(effect, before, values)
        unit = "rate, rad/s" if sensor else "torque, N m"
        return "time, s", unit, [("before", TIME, before), ("after", TIME, after)]
    torque = _along(effect, values)
    if effect.name in OVER_TIME:
        return "time, s", "torque T, N m", [("", TIME, torque)]
    if effect.name in OVER_RATE:
        order = np.argsort(RATE[:1000])
        return "rate, rad/s", "torque T, N m", [("", RATE[:1000][order], torque[:1000][order])]
    if effect.name == "load_dependent_friction":
        return "torque on the shaft, N m", "torque T, N m", [("", TORQUE, torque)]
    return "angle, rad", "torque T, N m", [("", ANGLE, torque)]


def _filtered(effect: Effect, x: Array, values: tuple[float, ...]) -> Array:
    size = effect.filter_states(1e-3, values) if effect.filter_states else 0
    out = np.array(x)
    ends = np.array([0, size]), np.array([0, len(values)])
    run_filter(addresses([effect.kernel]), out, 1e-3, np.zeros(size), ends[0], np.array(values), ends[1])
    return out


def _along(effect: Effect, values: tuple[float, ...]) -> Array:
    """The torque of an effect along two swings of 1 Hz, its states by fifty Euler steps a millisecond."""
    rest = effect.rest_state(ANGLE[0], RATE[0]) if effect.rest_state else (0.0,) * effect.states
    z, dz = (c_double * max(1, effect.states))(*rest), (c_double * max(1, effect.states))()
    p = (c_double * (3 + len(values)))(*JCK, *values)
    friction = effect.place is Place.FRICTION
    out = np.zeros_like(TIME)
    for i, (t, th, w, m) in enumerate(zip(TIME, ANGLE, RATE, TORQUE, strict=True)):
        level = effect.kernel.ctypes(th, abs(w) if friction else w, t, m, z, dz, p)
        out[i] = level * (np.sign(w) if friction else 1.0)
        for k in range(50 if effect.states else 0):
            s = t + k * 2e-5
            at = 0.16 * math.sin(2 * math.pi * s), 0.16 * 2 * math.pi * math.cos(2 * math.pi * s)
            effect.kernel.ctypes(at[0], at[1], s, m, z, dz, p)
            for j in range(effect.states):
                z[j] += 2e-5 * dz[j]
    return out


def _bounds(p: Parameter) -> str:
    low = "" if p.low == -math.inf else f"{p.low:g} ≤ "
    high = "" if p.high == math.inf else f" ≤ {p.high:g}"
    return f"{low}value{high}" if low or high else "any sign"


def page(effect: Effect) -> str:
    """The page of one effect as markdown."""
    rows = [
        f"| `{p.name}` | {p.unit} | {_bounds(p)} | {'solved' if p.linear else 'searched'}"
        f"{', one per run' if p.per_run else ''} | `{p.key}` | {p.meaning} |"
        for p in effect.parameters
    ]
    drawn = ", ".join(f"{k} {v:g}" for k, v in SIZES[effect.name].items())
    where = {
        Place.DRIVE: "between the recorded torque and the shaft",
        Place.LOAD: "at the shaft: J a + C w + K th + T = M",
        Place.FRICTION: "at the shaft: J a + C w + K th + T = M; the platform may stick and break away",
        Place.SENSOR: "between the rate and the reading of the gyro",
    }[effect.place]
    out = [
        f"# {effect.name}", "", effect.meaning, "", f"    {effect.equation}", "",
        "th: angle in rad, w: rate in rad/s, a: acceleration in rad/s^2, t: time in s from the start of the run,",
        "M: torque on the shaft in N m.",
        f"Acts {where}.",
        "", f"![{effect.name}](figures/{effect.name}.svg)", "",
        f"Drawn for {drawn} and a motion of 0.16 rad at 1 Hz.", "",
        f"**Family** {effect.family} · **Source** {effect.source}", "", f"**Sign** {effect.sign}", "",
        "| parameter | unit | bounds | how found | key in rig.yaml | meaning |", "|---|---|---|---|---|---|", *rows,
    ]  # fmt: skip
    for form in effects.forms(effect.name):
        other = effects.get(form)
        out += [
            "", "## In another form", "", f"Models may hold `{form}`, which goes by the same name in a verdict:", "",
            f"    {other.equation}", "", f"**Source** {other.source}",
        ]  # fmt: skip
    out += ["", "## What it is confused with", ""]
    out += [
        f"- `{rival}`{', always' if alike.travel_deg == math.inf else ''}: {alike.why}."
        for rival, alike in (effect.never_separable or {}).items()
    ]
    out += [f"- `{simpler}`, which it contains as a special case." for simpler in effect.nests]
    out += [f"- `{wider}`, which contains it." for wider in effects.names() if effect.name in effects.get(wider).nests]
    out += [f"- `{low}` has to be in the model first." for low in effect.lower_order]
    if effect.separated_by:
        out.append(f"- To distinguish it {effect.separated_by}.")
    if effect.name == "rate_bias":
        out.append("- Nothing: it is fitted as a nuisance parameter in every run measured by a gyro.")
    return "\n".join([*out, ""])


def index() -> str:
    """The list of all effects."""
    out = [
        "# Effects", "",
        "One object each in `rig/effects/`, read by simulator, identifier, report and these pages",
        "(`python -m benchmarks.effect_pages`). [An effect of your own](your-own.md) is a file of thirty lines;",
        "[a measured channel](channels.md) (a current, a temperature, another axis) may be a cause too.",
        "[How an effect is named](../how-an-effect-is-named.md) says when the identifier reports one.", "",
        "| effect | family | equation |", "|---|---|---|",
    ]  # fmt: skip
    for name in effects.names():
        e = effects.get(name)
        out.append(f"| [{name}]({name}.md) | {e.family} | `{e.equation.replace('|', chr(92) + '|')}` |")
    return "\n".join([*out, ""])


def main() -> None:
    """Write all pages and pictures."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    (FOLDER / "figures").mkdir(parents=True, exist_ok=True)
    for name in effects.names():
        effect = effects.get(name)
        (FOLDER / f"{name}.md").write_text(page(effect), encoding="utf-8")
        (FOLDER / "figures" / f"{name}.svg").write_text(svg(panel("", *series(effect))), encoding="utf-8")
    (FOLDER / "README.md").write_text(index(), encoding="utf-8")


if __name__ == "__main__":
    main()
