"""The frozen recordings: short ones of the blind bench's platforms, each effect once, and pieces of measured sets.

They are made without the product, so that a change in it cannot change them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import signal

from benchmarks.blind.cases import Order, make
from benchmarks.blind.excitations import DECAY, Excitation
from benchmarks.blind.hidden import Hidden
from benchmarks.blind.library import LIBRARY
from benchmarks.blind.recordings import WRITERS, rig_yaml, write_case, write_runs

SEED = 20221  # of every draw
SIZE = 0.05  # of the torque: what an effect adds, root mean square
NOISE = 1  # the middle of the bench's three levels: 0.05 deg/s, or 5e-5 rad
CAMPAIGN = "short"
OUTSIDE_ONES = ("bump_stop", "shaken_stiffness", "sagging_gain")
PAIRS = (
    ("coulomb_friction", "torque_delay"), ("cubic_stiffness", "quadratic_damping"), ("hysteresis", "actuator_lag"),
)  # fmt: skip
LAG_S = 2e-3  # of the gyro of second order
ADDED_KG_M2, TORQUE_SCALE = 0.004, 1.05  # a known inertia, mounted in half of the runs, tells the torque's scale
FRICTION_NM, DECAY_S, FREE_FROM_S = 0.5, 6.0, 1.6  # of the decay: its friction, its end, and when it is let go for sure
DATA = Path(__file__).parents[3] / "shared" / "data"


@dataclass(frozen=True)
class Measured:
    """Files of one measured rig, from and to which second they are read (None: all of it), the rest of rig.yaml."""

    files: tuple[str, ...]
    part_s: tuple[float, float] | None
    recorded: str = ""
    model: str = ""


MEASURED: Mapping[str, Measured] = {
    "lorenz_servo": Measured(
        ("run01.npz", "run02.npz"), (0.0, 8.0), "",
        "model: {inertia_kg_m2: 1.0e-3, damping_nm_s_rad: 1.0e-3, stiffness_nm_rad: 0.01}\n",
    ),
    "emps": Measured(
        ("emps_train.npz",), (0.0, 12.0), "  axis: linear\n  columns: {time: t_s, angle: q_m, torque: force_N}\n",
        "model: {inertia_kg_m2: 30.0, damping_nm_s_rad: 50.0, stiffness_nm_rad: 10.0}\n",
    ),
    "pendulum_decay": Measured(("pendulum_b.npz",), (5.0, 20.0), "  columns: {time: t_s, angle: theta_rad}\n"),
    "sydney_leg": Measured(("innerSW.npz",), None, "  columns: {torque: torque}\n"),
    "odrive_cogging": Measured(("slow2_nocomp_0.npz", "slow2_nocomp_1.npz"), None, "  columns: {torque: torque_nm}\n"),
    "qube_furuta": Measured(("run00.npz", "run01.npz"), (0.0, 10.0), "  columns: {torque: torque}\n"),
}  # fmt: skip


def simulated() -> dict[str, Callable[[Path], None]]:
    """Name of a recording -> what writes it into a folder, in a fixed order."""
    out: dict[str, Callable[[Path], None]] = {}
    orders = [Order("single", (name,), SIZE, NOISE, CAMPAIGN) for name in LIBRARY]
    orders += [Order("pair", pair, SIZE, NOISE, CAMPAIGN) for pair in PAIRS]
    orders += [Order("outside", (name,), SIZE, NOISE, CAMPAIGN) for name in OUTSIDE_ONES]
    orders += [Order("clean", (), SIZE, level, CAMPAIGN) for level in (0, 2)]
    for number, order in enumerate(orders):
        name = "+".join(order.effects) or f"clean_{order.noise}"
        out[name] = lambda folder, n=number, o=order: _blind(folder, n, o)  # type: ignore[misc]
    out["sensor_lag_second_order"] = _second_order_lag
    out["torque_scale"] = _torque_scale
    out["decay"] = _decay
    return out


def record(folder: Path, only: Sequence[str] = ()) -> list[str]:
    """Write the recordings, each with its rig.yaml, into folders of their own. Returns their names.

    Sets that were measured are read where they stand; those that are absent are left out. ``only`` these where given.
    """
    names = []
    for name, write in simulated().items():
        if not only or name in only:
            (folder / name).mkdir(parents=True, exist_ok=True)
            write(folder / name)
            names.append(name)
    for name, measured in MEASURED.items():
        if (not only or name in only) and (DATA / name).is_dir():
            (folder / name).mkdir(parents=True, exist_ok=True)
            (folder / name / "rig.yaml").write_text(_of_measured(name, measured), encoding="utf-8")
            names.append(name)
    return names


def _blind(folder: Path, number: int, order: Order) -> None:
    write_case(make(SEED, number, order), folder, folder / "truth.json")


def _second_order_lag(folder: Path) -> None:
    """A clean campaign, its rate behind a Butterworth low-pass of second order that lags by ``LAG_S``."""
    case = make(SEED, 100, Order("clean", (), SIZE, 0, CAMPAIGN))
    corner_hz = math.sqrt(2.0) / LAG_S / (2.0 * math.pi)
    sos = signal.butter(2, corner_hz, fs=1.0 / case.hidden.step_s, output="sos")
    seen = [replace(r, sensed_rate_rad_s=signal.sosfilt(sos, r.sensed_rate_rad_s)) for r in case.records]
    rng = np.random.default_rng([SEED, 101])
    hidden = replace(case.hidden, channel="rate")
    measured = [hidden.measured(r, rng) for r in seen]
    files = write_runs(hidden, seen, measured, folder, ".npz")
    text = rig_yaml(folder.name, files, ["auto"] * len(files), case.declared)
    (folder / "rig.yaml").write_text(text, encoding="utf-8")


def _torque_scale(folder: Path) -> None:
    """A wrong torque scale, and the same sets once more with a known inertia mounted."""
    case = make(SEED, 102, Order("clean", (), SIZE, NOISE, CAMPAIGN))
    plain = replace(case.hidden, channel="rate", noise=math.radians(0.05), torque_scale=TORQUE_SCALE)
    loaded = replace(plain, inertia=plain.inertia + ADDED_KG_M2)
    rng = np.random.default_rng([SEED, 103])
    runs = ""
    for first, hidden in ((1, plain), (11, loaded)):
        records = hidden.play(case.sets)
        files = write_runs(hidden, records, [hidden.measured(r, rng) for r in records], folder, ".npz", first)
        added = f"      added_inertia_kg_m2: {ADDED_KG_M2}\n" if hidden is loaded else ""
        runs += "".join(f"    - file: {file}\n{added}" for file in files)
    head = rig_yaml(folder.name, (), (), case.declared)
    (folder / "rig.yaml").write_text(head + runs, encoding="utf-8")


def _decay(folder: Path) -> None:
    """A platform with dry friction, let go: an encoder's angle after the release, and no torque."""
    effects = {"coulomb_friction": {"level": FRICTION_NM}}
    hidden = Hidden(0.02, 0.03, 60.0, effects, 5e-5, channel="angle", phase_seed=SEED, step_s=2e-3)
    pull = Excitation("decay", DECAY, (10.0, DECAY_S, 0.0, 1.0, 0.5, 0.01))
    (played,) = hidden.play([pull])
    angle = hidden.measured(played, np.random.default_rng([SEED, 104]))
    free = played.time_s > FREE_FROM_S
    WRITERS[".npz"](folder / "run1.npz", {"time_s": played.time_s[free], "angle_rad": angle[free]})
    (folder / "rig.yaml").write_text("backend: recorded\nrecorded:\n  runs:\n    - file: run1.npz\n", encoding="utf-8")


def _of_measured(name: str, measured: Measured) -> str:
    part = "" if measured.part_s is None else f"      from_s: {measured.part_s[0]}\n      to_s: {measured.part_s[1]}\n"
    runs = "".join(f"    - file: {DATA / name / file}\n{part}" for file in measured.files)
    head = f"name: {name}\nbackend: recorded\n{measured.model}"
    return f"{head}recorded:\n{measured.recorded}  runs:\n{runs}"
