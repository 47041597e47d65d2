"""Recordings of rigs that nobody here made: `python -m benchmarks.measured DIR [--only NAME ...]`.

Each recording is one process of `identify-run`, one after the other, as a user of that rig would call it. What is told
is set beside what the source of the recording, or a plain regression of it, says (`../shared/data/README.md`); a
recording that is absent is left out. Recordings that were identified already are left alone.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[1])

from benchmarks.field.run import run_one

DATA = Path(__file__).parents[2] / "shared" / "data"
LIMIT_S = 600.0
LORENZ_MODEL = (
    "model: {inertia_kg_m2: 1.0e-3, damping_nm_s_rad: 1.0e-3, stiffness_nm_rad: 0.01}\nidentify: {lowpass_hz: 15}\n"
)
DRY = "coulomb_friction|presliding_friction"  # the second is the first that lets go over a small angle
LORENZ = tuple(f"run0{i}.npz" for i in range(1, 6))


@dataclass(frozen=True)
class Case:
    """A recording, how it is declared, and what is asked of the answer.

    Attributes
    ----------
    folder, files, held_out
        Where its files are; those that are only to judge (none: the tool's own choice).
    recorded, model
        The rest of ``rig.yaml``.
    named
        Effects that have to be named; of several beside a bar, one.
    left_percent
        At most, of the torque, what is left on samples held out; None: nothing is asked.
    numbers
        Parameter (or effect.parameter) -> its value and by how many percent it may be off.
    accepted
        Whether the model is to be accepted; None where the source says that it cannot be sure.
    window_s
        Beginning and end of what is used of each file, in its time; None: all of it.
    """

    folder: str
    files: tuple[str, ...]
    named: tuple[str, ...]
    held_out: tuple[str, ...] = ()
    recorded: str = ""
    model: str = ""
    left_percent: float | None = None
    numbers: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    accepted: bool | None = True
    window_s: tuple[float, float] | None = None

    def rig_yaml(self, name: str) -> str:
        """The configuration of this recording."""
        runs = ""
        for file in self.files:
            use = "" if not self.held_out else f"      use: {'holdout' if file in self.held_out else 'fit'}\n"
            part = "" if self.window_s is None else "      from_s: {}\n      to_s: {}\n".format(*self.window_s)
            runs += f"    - file: {DATA / self.folder / file}\n{use}{part}"
        return f"name: {name}\nbackend: recorded\n{self.model}recorded:\n{self.recorded}  runs:\n{runs}"


def _lorenz(files: Sequence[str] = LORENZ, held_out: Sequence[str] = ()) -> Case:
    return Case(
        "lorenz_servo", tuple(files), ("coulomb_friction", "torque_offset"), tuple(held_out),
        "  min_rate_rad_s: 1.0\n", LORENZ_MODEL, 6.5,
        {"inertia": (1.77e-4, 3.0)},
    )  # fmt: skip


def _leg(file: str, inertia: float, gravity: float, left_percent: float) -> Case:
    return Case(
        "sydney_leg", (file,), ("unbalance", DRY), (), "  columns: {torque: torque}\n", "",
        left_percent, {"inertia": (inertia, 7.0), "unbalance.sine": (gravity, 7.0)},
    )  # fmt: skip


CASES: Mapping[str, Case] = {
    "lorenz_split": _lorenz(held_out=LORENZ[3:]),
    "lorenz_all": _lorenz(),
    **{f"lorenz_run{i + 1}": _lorenz((file,)) for i, file in enumerate(LORENZ)},
    **{f"lorenz_out{i + 1}": _lorenz(held_out=(file,)) for i, file in enumerate(LORENZ)},
    "emps": Case(
        "emps", ("emps_train.npz",), ("coulomb_friction", "torque_offset", "directional_damping"), (),
        "  axis: linear\n  columns: {time: t_s, angle: q_m, torque: force_N}\n",
        "model: {inertia_kg_m2: 30.0, damping_nm_s_rad: 50.0, stiffness_nm_rad: 10.0}\n", None,
        {"inertia": (95.1089, 3.0), "coulomb_friction.level": (20.3935, 5.0)},
    ),
    "pendulum": Case(
        "pendulum_decay", ("pendulum_b.npz",), ("unbalance", DRY, "quadratic_damping"), (),
        "  columns: {time: t_s, angle: theta_rad}\n", window_s=(5.0, 118.0),
    ),
    "leg_inner": _leg("innerSW.npz", 0.236, 16.8, 13.6),
    "leg_outer": _leg("outerSW.npz", 0.239, 18.8, 10.9),
    "odrive_comp": Case(
        "odrive_cogging", tuple(f"slow2_comp_{i}.npz" for i in range(3)), ("cogging",), (),
        "  columns: {torque: torque_nm}\n", "", 12.0, accepted=None,
    ),
    "odrive_nocomp": Case(
        "odrive_cogging", tuple(f"slow2_nocomp_{i}.npz" for i in range(3)), ("cogging",), (),
        "  columns: {torque: torque_nm}\n", "", None, accepted=None,
    ),
    "qube": Case(
        "qube_furuta", tuple(f"run0{i}.npz" for i in range(6)), ("pendulum_torque",), (),
        "  columns: {torque: torque, channels: {pendulum: {column: pendulum_rad, kind: angle}}}\n", "", 6.0,
        accepted=None,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Answer:
    """What was told of one recording; ``short`` says in which of what was asked it falls short."""

    name: str
    named: tuple[str, ...]
    accepted: bool | None
    left_percent: float | None
    seconds: float
    peak_mib: float
    short: tuple[str, ...]


def judge(name: str, case: Case, result: Mapping[str, Any] | None, ran: Mapping[str, Any]) -> Answer:
    """Set an answer beside what was asked."""
    if result is None or result.get("aborted"):
        return Answer(name, (), None, None, ran["seconds"], ran["peak_mib"], (f"exit {ran['exit_code']}",))
    final = result["after"] or result["before"]
    named, error = tuple(result["verdict"]["effects"]), final["error"]
    left = error["holdout_torque_relative"] or error["residual_torque_relative"]
    left_percent = None if left is None else 100.0 * left
    short = [f"{asked} not named" for asked in case.named if not set(asked.split("|")) & set(named)]
    if case.left_percent is not None and (left_percent is None or left_percent > case.left_percent):
        short.append(f"at most {case.left_percent:g} % asked")
    for parameter, (value, percent) in case.numbers.items():
        short += _off(final, parameter, value, percent)
    if case.accepted is not None and result["accepted"] is not case.accepted:
        short.append("accepted" if result["accepted"] else "not accepted")
    return Answer(name, named, result["accepted"], left_percent, ran["seconds"], ran["peak_mib"], tuple(short))


def _off(final: Mapping[str, Any], parameter: str, value: float, percent: float) -> list[str]:
    effect, _, of = parameter.rpartition(".")
    found = (final["effect_parameters"].get(effect) or {}).get(of) if effect else final["parameters"].get(of)
    if found is None:
        return [f"{parameter} not determined"]
    off = 100.0 * (found["value"] / value - 1.0)
    return [f"{parameter} {off:+.1f} %, {percent:g} allowed"] if abs(off) > percent else []


def table(answers: Sequence[Answer]) -> str:
    """A line for each recording."""
    lines = ["| recording | named | accepted | left % | s | MiB | falls short |", "|---|---|---|---|---|---|---|"]
    for a in answers:
        left = "" if a.left_percent is None else f"{a.left_percent:.1f}"
        accepted = {True: "yes", False: "no", None: ""}[a.accepted]
        cells = (
            a.name,
            ", ".join(a.named),
            accepted,
            left,
            f"{a.seconds:.0f}",
            f"{a.peak_mib:.0f}",
            "; ".join(a.short),
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> int:
    """Command line. Returns 1 where an answer falls short of what is asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="DIR")
    parser.add_argument("--command", default=str(Path(sys.executable).parent / "identify-run"), help="what to run")
    parser.add_argument("--only", nargs="*", default=[], choices=list(CASES), metavar="NAME", help=", ".join(CASES))
    a = parser.parse_args()
    answers = []
    for name, case in CASES.items():
        if (a.only and name not in a.only) or not (DATA / case.folder).is_dir():
            continue
        folder, record = a.out / name, a.out / f"{name}.run.json"
        if not record.exists():
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "rig.yaml").write_text(case.rig_yaml(name), encoding="utf-8")
            ran = run_one(folder, folder / "results", shlex.split(a.command), LIMIT_S)
            record.write_text(json.dumps(ran) + "\n", encoding="utf-8")
        told = folder / "results" / "result.json"
        result = json.loads(told.read_text(encoding="utf-8")) if told.exists() else None
        answers.append(judge(name, case, result, json.loads(record.read_text(encoding="utf-8"))))
        print(table(answers[-1:]).splitlines()[-1], file=sys.stderr, flush=True)
    print(table(answers))
    return int(any(a.short for a in answers))


if __name__ == "__main__":
    sys.exit(main())
