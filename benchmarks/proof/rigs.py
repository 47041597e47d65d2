"""A rig with one hidden effect of known size: its campaign, a model fitted to that, and the proof of the model.

The rig is simulated: commands held for 1 ms in steps of 0.12 N m and the gyro's noise of 0.05 deg/s, as in
examples/bench.yaml, but 1000 samples a second without a low-pass, and no tick is ever late. The model has the structure
that is asked for, right or wrong; its numbers are fitted to the campaign by the identification itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identify.pipeline import identify
from identify.proof.compensation import along, linear_part
from identify.proof.drive import Drive, resolution_of
from identify.proof.plan import ProofPlan, plan_proof
from identify.proof.verdict import judge
from identify.proven import Proof
from identify.results import Identification
from rig import effects
from rig.clock import VirtualClock
from rig.config.load import check_config
from rig.config.root import Config
from rig.dynamics import TorqueSignal, simulate
from rig.effects.base import Place
from rig.errors import RigError
from rig.excitation import PlannedSet
from rig.guard import Guard
from rig.guard.motion import motion_checks
from rig.platform import Platform
from rig.preflight import allowed_peaks, plan
from rig.recording.run import Recording
from rig.sequencer import Sequencer
from sim_backend.simulated import SimulatedRig

TRUE = Platform(0.0203, 0.0447, 681.2)
TICK_S, STEP_NM = 1e-3, 0.12
SETS = ((60.0, 0.5), (60.0, 3.0), (30.0, 9.0))  # N m, Hz
SET_S = 6.0
# Shapes of each effect, and where it has no gain its size; a gain is scaled to the share of the torque asked for.
SHAPES: Mapping[str, Mapping[str, float]] = {
    "coulomb_friction": {"level": 1.0},
    "stribeck_friction": {"coulomb": 1.0, "static": 1.15, "speed": 0.2},
    "presliding_friction": {"level": 1.0, "displacement": 2e-3},
    "load_dependent_friction": {"factor": 0.03},
    "quadratic_damping": {"factor": 0.01},
    "directional_damping": {"step": 0.02},
    "cubic_stiffness": {"factor": 1000.0},
    "quadratic_stiffness": {"factor": 200.0},
    "bilinear_stiffness": {"step": 20.0},
    "backlash": {"half_gap": 1.5e-3},
    "hysteresis": {"level": 1.0, "yield_angle": 0.02, "exponent": 1.5, "share": 0.5},
    "creep": {"stiffness": 20.0, "time": 0.3},
    "cogging": {"sine": 1.0, "cosine": 0.0, "order": 60.0},
    "unbalance": {"sine": -8.0, "cosine": 0.0},
    "flexible_mode": {"inertia": 0.0008, "frequency": 60.0, "ratio": 0.02},
    "torque_delay": {"delay": 0.0008},
    "actuator_lag": {"time": 0.0012},
    "torque_deadzone": {"width": 1.2},
    "torque_scale": {"scale": 1.03},
    "torque_saturation": {"limit": 52.0},
    "periodic_disturbance": {"sine": 0.2, "cosine": 0.1, "frequency": 11.3},
    "sensor_lag": {"time": 0.001},
    "stiffness_drift": {"slope": 0.5},
}  # fmt: skip
# Their torque has no jump, and no corner that comes within a tick (presliding friction turns round in one).
SMOOTH = frozenset({
    "quadratic_damping", "directional_damping", "cubic_stiffness", "quadratic_stiffness", "bilinear_stiffness", "creep",
    "cogging", "unbalance", "flexible_mode", "torque_delay", "torque_scale", "hysteresis",
})  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """One proof: its verdict, or why there is none; ``model`` is what was compensated."""

    model: Platform | None
    proof: Proof | None
    why: str = ""
    most_travel: float = 0.0  # largest travel of the runs over the limit


def sized(name: str, share: float, rng: np.random.Generator) -> dict[str, float]:
    """Values of an effect that acts with ``share`` of the torque (root mean squares over the 3 Hz set)."""
    effect = effects.get(name)
    given = {k: float(v) for k, v in SHAPES[name].items()}
    for p in effect.parameters:
        if not p.linear and name not in ("torque_scale", "torque_saturation"):
            given[p.name] *= float(rng.uniform(0.8, 1.25))
    acts_on_shaft = effect.place in (Place.LOAD, Place.FRICTION) and effect.foreseen
    if not acts_on_shaft or not any(p.linear for p in effect.parameters):
        return given
    time_s = np.arange(0.0, SET_S, 0.5 * TICK_S)
    torque = SETS[1][0] * np.sin(2.0 * math.pi * SETS[1][1] * time_s)
    motion = simulate(TRUE, time_s, TorqueSignal(time_s, torque))
    acts = along(replace(TRUE, effects={name: given}), name, time_s, motion, torque)
    factor = share * float(np.sqrt(np.mean(torque**2)) / np.sqrt(np.mean(acts**2)))
    return given | {p.name: factor * given[p.name] for p in effect.parameters if p.linear}


def config_of(hidden: Mapping[str, Mapping[str, float]], seed: int) -> Config:
    """The rig with its hidden effects, and its campaign."""
    platform: dict[str, Any] = {
        "inertia_kg_m2": TRUE.inertia_kg_m2, "damping_nm_s_rad": TRUE.damping_nm_s_rad,
        "stiffness_nm_rad": TRUE.stiffness_nm_rad,
    }  # fmt: skip
    keyed = {
        n: {p.key: float(v[p.name]) for p in effects.get(n).parameters} for n, v in hidden.items()
    }  # fmt: skip
    sets = [{"torque_nm": nm, "frequency_hz": hz, "duration_s": SET_S} for nm, hz in SETS]
    return check_config(
        {
            "name": "proof", "backend": "simulated",
            "simulated": {
                "seed": seed, "platform": platform | {"effects": keyed}, "gyro": {"noise_deg_s": 0.05},
                "amplifier": {"kind": "hold", "resolution_nm": STEP_NM},
            },
            "limits": {"travel_deg": 10.0, "rate_deg_s": 400.0, "torque_nm": 150.0},
            "excitation": {"rest_s": 8.0, "scale_to_limits": True, "sets": sets},
        },
        "benchmarks.proof",
    )  # fmt: skip


def play(
    config: Config, sets: Sequence[PlannedSet], model: Platform, seed: int, rest_s: float | None = None
) -> tuple[Recording, RigError | None]:  # fmt: skip
    """The recording of sets on the rig, and what cut it short."""
    rest_s = config.excitation.rest_s if rest_s is None else rest_s
    rig = SimulatedRig(config.simulated, 1.0 / TICK_S, seed=seed)
    guard = Guard(config.limits, motion_checks(config.limits, model))
    sequencer = Sequencer(rig, VirtualClock(), guard, sample_rate_hz=1.0 / TICK_S, rest_s=rest_s, declared=model)
    campaign = sequencer.play(sets)
    return campaign.recording, campaign.cause


Player = Callable[
    [Config, Sequence[PlannedSet], Platform, int, float | None], tuple[Recording, RigError | None]
]  # fmt: skip
"""Plays sets on a rig as ``play`` does."""


def campaign(config: Config, seed: int, player: Player = play) -> Recording:
    """The campaign from which models are fitted."""
    recording, cause = player(config, plan(TRUE, config.excitation, config.limits), TRUE, seed, None)
    if cause is not None:
        raise cause
    return recording


def fitted(recording: Recording, name: str, start: Mapping[str, float]) -> Identification:
    """The model with one effect of that name, its numbers fitted from ``start``; nothing else is searched for."""
    settings = config_of({}, 1).identify.model_copy(update={"candidates": ()})
    return identify(replace(recording, info={}), replace(TRUE, effects={name: dict(start)}), settings)


def with_known_scale(model: Platform, scale: float) -> Platform:
    """The same model with a known scale of the torque, of which torque and rate tell only its ratios to J, C and K."""
    own = model.effects.get("torque_scale")
    if own is None:
        return model
    times = scale / own["scale"]
    return replace(
        model, inertia_kg_m2=times * model.inertia_kg_m2, damping_nm_s_rad=times * model.damping_nm_s_rad,
        stiffness_nm_rad=times * model.stiffness_nm_rad, effects={**model.effects, "torque_scale": {"scale": scale}},
    )  # fmt: skip


def proved(
    config: Config, recording: Recording, model: Platform, seed: int, noise: float,
    rivals: Mapping[str, Platform] | None = None, player: Player = play,
) -> Outcome:  # fmt: skip
    """The proof of a model, played on the rig; ``noise`` is what the identification takes for the sensor's.

    The ring of a run has to be lost in that before the next one, as in a proof that the commands play.
    """
    drive = Drive(TICK_S, "zero_order", resolution_of(recording))
    allowed = allowed_peaks(config.limits, config.excitation.margin)
    try:
        sets = plan(model, config.excitation, config.limits)
        planned: ProofPlan = plan_proof(
            model, sets, allowed, drive,
            rivals=rivals, recorded=recording.runs, rest_s=config.excitation.rest_s, noise=noise,
        )  # fmt: skip
    except RigError as error:
        return Outcome(model, None, f"refused: {str(error).splitlines()[0][:90]}")
    played, cause = player(config, planned.sets, model, seed + 1000, planned.rest_s)
    if cause is not None:
        return Outcome(model, None, f"stopped: {str(cause)[:90]}")
    return Outcome(model, judge(planned, played, model), most_travel=_travel(played) / config.limits.travel_deg)


def _travel(recording: Recording) -> float:
    """Largest angle from the start of a run in degrees, by the gyro, its bias taken as none."""
    largest = 0.0
    for run in recording.runs:
        assert run.rate_rad_s is not None
        step_s = float(np.median(np.diff(run.time_s)))  # the gyro's: it may give more samples than there are ticks
        largest = max(largest, float(np.max(np.abs(np.cumsum(run.rate_rad_s)))) * step_s)
    return math.degrees(largest)


def is_linear(model: Platform) -> bool:
    """Whether nothing but a sensor stands beside J, C and K."""
    return set(linear_part(model).effects) == set(model.effects)
