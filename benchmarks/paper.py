"""The paper's figures and tables, made anew beside the published numbers: docs/paper.md.

python -m benchmarks.paper [--results FOLDER]

Plays `examples/table1.yaml` and `examples/table2.yaml` for five seeds of the gyro's noise each (about eight
minutes on two cores). With --results, campaigns that stand in that folder already are read and not played again.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.line_chart import panel, stacked, svg
from identify.bounds.cramer_rao import of_planned
from identify.estimate.regression import Regression, fit
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from rig.config.excitation import PAPER_SETS
from rig.dynamics import TorqueSignal, simulate
from rig.excitation import PlannedSet, Sine, planned
from rig.platform import TERMS, Platform
from rig.preflight import peaks
from rig.recording.run import Recording, Run

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
SEEDS = (1, 2, 3, 4, 5)
NOISE_RAD_S = math.radians(0.05)
PLATFORM = Platform(0.02, 0.045, 677.3)
TRAVEL_DEG, FULL_SCALE_DEG_S = 10.0, 400.0
FRICTION = {"coulomb": 3.2, "static": 5.0, "speed": 0.08}  # of examples/table2.yaml
HEADS = {"inertia": "J, kg m^2", "damping": "C, N m s/rad", "stiffness": "K, N m/rad"}
PUBLISHED: dict[str, dict[str, tuple[float, float, float]]] = {
    "table1": {
        "reference": (0.02, 0.045, 677.3),
        "0.5": (0.02012, 0.04532, 679.156), "1": (0.01988, 0.04481, 677.861), "3": (0.01981, 0.04463, 678.264),
        "6": (0.02018, 0.04541, 676.812), "9": (0.01984, 0.04473, 675.032), "largest": (0.95, 0.91, 0.33),
    },
    "table2": {
        "reference": (0.0202, 0.0454, 674.325),
        "0.5": (0.0203, 0.0451, 677.301), "1": (0.0208, 0.0461, 679.145), "3": (0.0196, 0.0456, 670.754),
        "6": (0.0197, 0.0448, 668.015), "9": (0.0206, 0.0453, 676.412), "largest": (2.97, 2.86, 1.65),
    },
}  # fmt: skip


def sets(scale: Sequence[float] = (1.0,) * 5, **more: float) -> tuple[PlannedSet, ...]:
    """The five sets of the paper (Fig. 6), each times a factor."""
    return planned(
        [Sine(torque_nm=s * m, frequency_hz=f, duration_s=10, **more)
         for s, (m, f) in zip(scale, PAPER_SETS, strict=True)]
    )  # fmt: skip


def played(folder: Path) -> dict[str, list[dict[str, Any]]]:
    """result.json of both tables for every seed; what stands in ``folder`` is not played again."""
    found: dict[str, list[dict[str, Any]]] = {}
    for table in PUBLISHED:
        found[table] = []
        for seed in SEEDS:
            out = folder / f"{table}-seed{seed}"
            if not (out / "result.json").exists():
                print(f"playing {table}, seed {seed}", file=sys.stderr)
                command = [sys.executable, "-c", "from commands.identify_run import main; main()"]
                config = str(ROOT / "examples" / f"{table}.yaml")
                subprocess.run([*command, config, "--seed", str(seed), "--quiet", "--out", str(out)], check=True)
            found[table].append(json.loads((out / "result.json").read_text(encoding="utf-8")))
    return found


def figures() -> None:
    """Fig. 4 (Eq. 7), Fig. 6 (torques) and Fig. 7 (angles)."""
    rate = np.linspace(-1.0, 1.0, 2001)
    level = FRICTION["coulomb"] + (FRICTION["static"] - FRICTION["coulomb"]) * np.exp(
        -((rate / FRICTION["speed"]) ** 2)
    )
    curve = level * np.sign(rate)
    lines = [("", rate, curve), ("with sigma 2 N m s/rad", rate, curve + 2.0 * rate)]
    chart = panel("Friction of Eq. 7", "rate, rad/s", "friction torque, N m", lines)
    (DOCS / "figures" / "paper_fig4.svg").write_text(svg(chart), encoding="utf-8")
    time = np.arange(20_001) * 1e-4
    torques, angles = [], []
    for one in sets():
        torque = np.asarray(one.torque(time))
        angle = np.degrees(simulate(PLATFORM, time, TorqueSignal(time, torque)).angle_rad)
        torques.append((one.name, [("", time, torque)]))
        box = np.array([0.0, time[-1], time[-1], 0.0]), TRAVEL_DEG * np.array([1.0, 1.0, -1.0, -1.0])
        label = "" if angles else "the paper's limit of 10 deg"
        angles.append((one.name, [("", time, angle), (label, *box)]))
    write = (("paper_fig6.svg", torques, "torque, N m"), ("paper_fig7.svg", angles, "angle, deg"))
    for name, panels, label in write:
        (DOCS / "figures" / name).write_text(stacked(panels, "time, s", label), encoding="utf-8")


def table_of(table: str, results: Sequence[Mapping[str, Any]]) -> str:
    """Published and found values of one table side by side, then the largest errors of every seed."""
    published = PUBLISHED[table]
    out = [
        "| | " + " | ".join(f"{HEADS[t]}, paper | ours" for t in TERMS) + " |", "|---" * 7 + "|",
        "| reference | " + " | ".join(f"{published['reference'][i]:g} |" for i in range(3)) + " |",
    ]  # fmt: skip
    for one in results[0]["per_set"]:
        key = f"{one['frequency_hz']:g}"
        cells = [f"{published[key][i]:g} | {_value(one, t)}" for i, t in enumerate(TERMS)]
        out.append(f"| {key} Hz | " + " | ".join(cells) + " |")
    largest = [max(r["max_error_percent"][t] for r in results) for t in TERMS]
    cells = [f"{published['largest'][i]:g} % | **{largest[i]:.2g} %**" for i in range(3)]
    out += ["| largest error (Eq. 15), five seeds | " + " | ".join(cells) + " |", ""]
    out += ["| seed | " + " | ".join(f"{t}, %" for t in TERMS) + " | named | accepted |", "|---" * 6 + "|"]
    for seed, r in zip(SEEDS, results, strict=True):
        errors = " | ".join(f"{r['max_error_percent'][t]:.2g}" for t in TERMS)
        named = ", ".join(r["verdict"]["effects"]) or "nothing"
        out.append(f"| {seed} | {errors} | {named} | {'yes' if r['accepted'] else 'no'} |")
    return "\n".join(out)


def _value(one: Mapping[str, Any], term: str) -> str:
    held = one["parameters"].get(term)
    return f"{held['value']:.6g}" if held else "not determined"


def travel_table() -> str:
    """What the published torques do, and what a limit of travel or a full scale leaves of them."""
    out = [
        "| set | travel, deg | without the ring | rate, deg/s | within 10 deg, N m | without the ring "
        "| within 400 deg/s too, N m |", "|---" * 7 + "|",
    ]  # fmt: skip
    for (m, f), one in zip(PAPER_SETS, sets(), strict=True):
        found, steady = peaks(PLATFORM, one), m * _gain_deg(f)
        allowed = m * min(TRAVEL_DEG / found.travel_deg, 1.0)
        slower = min(allowed, m * FULL_SCALE_DEG_S / found.rate_deg_s)
        cells = [
            f"{m:g} N m at {f:g} Hz", f"**{found.travel_deg:.1f}**", f"{steady:.1f}", f"{found.rate_deg_s:.0f}",
            f"{allowed:.1f}", f"{m * TRAVEL_DEG / steady:.1f}", f"{slower:.1f}",
        ]  # fmt: skip
        out.append("| " + " | ".join(cells) + " |")
    return "\n".join(out)


def _gain_deg(frequency_hz: float) -> float:
    """Degrees of steady swing for one newton metre."""
    w = 2 * math.pi * frequency_hz
    p = PLATFORM
    return math.degrees(1 / abs(p.stiffness_nm_rad - p.inertia_kg_m2 * w * w + 1j * p.damping_nm_s_rad * w))


def bound_table() -> str:
    """Cramer-Rao bound of every set in percent: ring kept, and ring removed by a soft start."""
    scale = [TRAVEL_DEG / (m * _gain_deg(f)) for m, f in PAPER_SETS]
    out = ["| set | ring kept: J, % | C, % | K, % | soft start of 5 s: J, % | C, % | K, % |", "|---" * 7 + "|"]
    kept, soft = (
        [i.if_known() for i in of_planned(PLATFORM, several, 1000.0, NOISE_RAD_S)]
        for several in (sets(scale), sets(scale, soft_start_s=5.0))
    )
    for (_, f), a, b in zip(PAPER_SETS, kept, soft, strict=True):
        cells = [f"{100 * i.relative((t,)):.2g}" for i in (a, b) for t in TERMS]
        out.append(f"| {f:g} Hz | " + " | ".join(cells) + " |")
    return "\n".join(out)


def damping_table() -> str:
    """What an effect that is left out does to J, C and K fitted by low-passed equation error."""
    cases = {
        "nothing": {},
        "1.5 ms torque delay": {"torque_delay": {"delay": 1.5e-3}},
        "2 ms gyro lag": {"sensor_lag": {"time": 2e-3}},
        "3 ms current lag": {"actuator_lag": {"time": 3e-3}},
        "Coulomb friction of 1 N m": {"coulomb_friction": {"level": 1.0}},
        "Coulomb friction of 0.25 N m": {"coulomb_friction": {"level": 0.25}},
        "presliding friction of 1 N m": {"presliding_friction": {"level": 1.0, "displacement": 0.004}},
        "windage of 0.05 N m s^2/rad^2": {"quadratic_damping": {"factor": 0.05}},
    }
    out = ["| left out | J, % | C, % | K, % |", "|---" * 4 + "|"]
    for name, effects in cases.items():
        errors = [100 * (v / t - 1) for v, t in zip(equation_error(effects), (0.02, 0.045, 677.3), strict=True)]
        out.append(f"| {name} | " + " | ".join(f"{e:+.2g}" if abs(e) < 10 else f"{e:+.0f}" for e in errors) + " |")
    return "\n".join(out)


def equation_error(effects: Mapping[str, Mapping[str, float]]) -> tuple[float, float, float]:
    """J, C, K of five sets within 10 deg and 400 deg/s, both sides low-passed by second order at 120 Hz."""
    rng, runs = np.random.default_rng(1), []
    time = np.arange(10_001) * 1e-3
    truth = Platform(0.02, 0.045, 677.3, effects)
    for (m, f), one in zip(PAPER_SETS, sets(), strict=True):
        found = peaks(PLATFORM, one)
        scale = 0.95 * min(TRAVEL_DEG / found.travel_deg, FULL_SCALE_DEG_S / found.rate_deg_s)
        torque = TorqueSignal(time, scale * m * np.sin(2 * math.pi * f * time))
        rate = simulate(truth, time, torque).sensed_rate_rad_s + NOISE_RAD_S * rng.standard_normal(len(time))
        ok = np.ones(len(time), bool)
        runs.append(Run(one.name, time, ok, rate_rad_s=rate, torque_time_s=time, torque_nm=torque.torque_nm))
    traces = [prepare(run, i) for i, run in enumerate(Recording(tuple(runs)).runs)]
    # A disturbance that outweighs the sensor up to 120 Hz makes the filter a low-pass of the torque residual.
    rho = PLATFORM.inertia_kg_m2 * 2 * math.pi * 120.0
    solution = fit(Regression(traces, Structure()), {}, (0.02, 0.045, 677.3), rho)
    return solution.jck


def page(results: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """docs/paper.md."""
    before = [r["before"]["parameters"]["damping"]["value"] for r in results["table2"]]
    wrong = 100 * (min(before) / 0.0454 - 1)
    after = results["table2"][0]["after"]
    friction = after["effect_parameters"].get("stribeck_friction", {})
    levels = ", ".join(f"{k} {v['value']:.5g} {v['unit']}" for k, v in friction.items())
    text = (Path(__file__).parent / "paper_template.md").read_text(encoding="utf-8")
    parts = {
        "TABLE1": table_of("table1", results["table1"]), "TABLE2": table_of("table2", results["table2"]),
        "TRAVEL": travel_table(), "BOUND": bound_table(), "DAMPING": damping_table(),
        "WRONG": f"{wrong:.0f}", "LEVELS": levels,
    }  # fmt: skip
    for key, value in parts.items():
        text = text.replace(f"@{key}@", value)
    return text


def main() -> None:
    """Play what is missing, then write page and figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, help="where the campaigns stand or are put")
    given = parser.parse_args().results
    with tempfile.TemporaryDirectory() as scratch:
        folder = given or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        results = played(folder)
    figures()
    (DOCS / "paper.md").write_text(page(results), encoding="utf-8")


if __name__ == "__main__":
    main()
