"""A hidden platform: its numbers, its effects, its sensor, and the motion it makes under a torque."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import brentq

from benchmarks.blind import integrator
from benchmarks.blind.excitations import Excitation
from benchmarks.blind.physics import CODES, STATES, SWITCHES

STEP_RAD = 0.2  # of the fastest motion in one step of eighth order: 1e-11 a step
CONSTANT = ("unbalance", "cogging", "torque_offset")  # loads that pull at rest
STICKING = {"coulomb_friction": "level", "stribeck_friction": "coulomb"}  # and the torque with which they hold
HELD = 0.9  # of how far beside the spring's rest they can
# What the compiled functions take, in their order. A name that ends in _run has one value a set.
ORDER: Mapping[str, tuple[str, ...]] = {
    "quadratic_damping": ("factor",), "directional_damping": ("step",), "cubic_stiffness": ("factor",),
    "quadratic_stiffness": ("factor",), "bilinear_stiffness": ("step",), "backlash": ("half_gap",),
    "hysteresis": ("level", "yield_angle", "exponent", "share"), "creep": ("stiffness", "time"),
    "stiffness_drift": ("slope",), "unbalance": ("sine", "cosine"), "cogging": ("sine", "cosine", "order"),
    "torque_offset": ("level",), "flexible_mode": ("inertia", "frequency", "ratio"),
    "periodic_disturbance": ("amplitude", "frequency", "phase_run"),
    "standing_tone": ("amplitude", "frequency", "phase_run"), "presliding_friction": ("level", "displacement"),
    "coulomb_friction": ("level",), "stribeck_friction": ("coulomb", "static", "speed"),
    "load_dependent_friction": ("factor",), "torque_delay": ("delay",), "actuator_lag": ("time",),
    "torque_saturation": ("limit",), "torque_deadzone": ("width",), "sensor_lag": ("time",), "rate_bias": ("bias",),
    "bump_stop": ("stiffness", "angle", "damper_s"), "hard_stops": ("stiffness", "angle", "other_angle"),
    "shaken_stiffness": ("depth", "frequency", "phase_run"), "two_relaxations": ("stiffness", "time", "other_time"),
    "friction_by_angle": ("level", "depth", "order", "phase"), "torque_ripple": ("amplitude", "period", "phase"),
    "warming_gain": ("loss", "time", "torque"), "coupling_slip": ("inertia", "stiffness", "slip", "damping"),
    "sagging_gain": ("loss",), "coarse_torque": ("amplitude", "period"),
    "aliased_vibration": ("amplitude", "frequency", "wander", "phase_run"), "cubic_gyro": ("factor",),
}  # fmt: skip


class Diverged(Exception):
    """The platform ran away."""


@dataclass(frozen=True)
class Record:
    """One set, free of noise. ``parts`` (n, effects) is the resisting torque each effect adds, in N m."""

    time_s: Any
    torque_nm: Any
    angle_rad: Any  # from the rest angle for a gyro, absolute for an encoder
    rate_rad_s: Any
    sensed_rate_rad_s: Any
    parts: Any


@dataclass(frozen=True)
class Hidden:
    """The truth of one case. ``effects`` maps a name to its numbers, in the units of the docs."""

    inertia: float
    damping: float
    stiffness: float
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    noise: float = math.radians(0.05)  # one standard deviation of the channel, rad/s or rad
    bias: float = 0.0  # rad/s
    channel: str = "rate"
    torque_scale: float = 1.0  # what the recording says over what acted
    phase_seed: int = 0
    step_s: float = 1e-3

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Hidden:
        """From ``as_json``."""
        return cls(**content)

    def rest_angle(self) -> float:
        """Where the platform stands without torque."""
        given = [(n, v) for n, v in self.effects.items() if n in CONSTANT]
        if not given:
            return 0.0

        def pull(th: float) -> float:
            total = self.stiffness * th
            for name, v in given:
                order = v.get("order", 1.0)
                if name == "torque_offset":
                    total += v["level"]
                else:
                    total += v["sine"] * math.sin(order * th) + v["cosine"] * math.cos(order * th)
            return total

        reach = 1.001 * sum(abs(x) for _, v in given for k, x in v.items() if k != "order") / self.stiffness
        return float(brentq(pull, -reach, reach, xtol=1e-14)) if reach > 0.0 else 0.0

    def play(self, sets: Sequence[Excitation], first: int = 0) -> list[Record]:
        """The motion in every set, each from rest; ``first`` is the number of the first set.

        Raises
        ------
        Diverged
            Where the platform runs away.
        """
        return [self._one(excitation, first + i) for i, excitation in enumerate(sets)]

    def _phase(self, number: int) -> float:
        return float(np.random.default_rng([self.phase_seed, number]).uniform(0.0, 2.0 * math.pi))

    def _numbers(self, name: str, number: int) -> list[float]:
        v = self.effects[name]
        return [self._phase(number) if k.endswith("_run") else v[k] for k in ORDER[name]]

    def _fastest(self, peak_rate: float) -> float:
        j, k = self.inertia, self.stiffness
        rates = [math.sqrt(k / j), self.damping / j]
        for name, v in self.effects.items():
            if name == "flexible_mode":
                rates.append(2.0 * math.pi * v["frequency"] * math.sqrt(1.0 + v["inertia"] / j))
            elif name in {"presliding_friction", "hysteresis"}:
                width = v.get("displacement") or v["yield_angle"]
                rates += [math.sqrt(k / j + v["level"] / width / j), 0.3 * v.get("exponent", 1.0) * peak_rate / width]
            elif name == "coupling_slip":
                rates += [math.sqrt(v["stiffness"] * (1 / j + 1 / v["inertia"])), v["damping"] / v["inertia"]]
            elif name in {"actuator_lag", "sensor_lag", "creep", "two_relaxations"}:
                rates.append(0.3 / v["time"])
            elif name == "bump_stop":
                rates.append(math.sqrt((k + v["stiffness"]) / j))
            elif name in {"cogging", "friction_by_angle"}:
                rates.append(v["order"] * peak_rate)
            elif name == "stribeck_friction":
                rates.append(STEP_RAD / self.step_s * 8.0)  # the rate runs through the knee in a fraction of a sample
            elif name in {"periodic_disturbance", "standing_tone", "shaken_stiffness"}:
                rates.append(2.0 * math.pi * v["frequency"])
            elif name in {"torque_ripple", "coarse_torque"}:
                rates.append(800.0)
        if any(CODES[n] // 100 == 1 for n in self.effects):
            rates.append(STEP_RAD / self.step_s * 3.0)
        return max(rates)

    def stuck_rad(self, number: int) -> float:
        """How far beside its rest dry friction holds the platform when a set begins: wherever the last one left it."""
        level = max((self.effects[n][k] for n, k in STICKING.items() if n in self.effects), default=0.0)
        return HELD * level / self.stiffness * float(np.random.default_rng([self.phase_seed, number, 1]).uniform(-1, 1))

    def _begin(self, zo: Any, size: int, number: int) -> tuple[Any, float]:
        rest = self.rest_angle()
        y = np.zeros(size)
        y[0] = rest
        if "standing_tone" in self.effects:  # it was there long before the set: its own steady motion
            v = self.effects["standing_tone"]
            s = 2j * math.pi * v["frequency"]
            answer = -v["amplitude"] / (self.inertia * s * s + self.damping * s + self.stiffness)
            turning = answer * np.exp(1j * self._phase(number))
            y[0] += turning.imag
            y[1] = (turning * s).imag
        y[0] += self.stuck_rad(number)
        for k, name in enumerate(self.effects):
            if name in {"creep", "flexible_mode", "two_relaxations"}:
                y[zo[k]] = y[0]
        return y, rest

    def _one(self, excitation: Excitation, number: int, substeps: int | None = None) -> Record:
        names = list(self.effects)
        zo = 2 + np.concatenate([[0], np.cumsum([STATES.get(n, 0) for n in names])]).astype(np.int64)
        so = np.concatenate([[0], np.cumsum([SWITCHES.get(n, 0) for n in names])]).astype(np.int64)
        numbers = [self._numbers(n, number) for n in names]
        po = np.concatenate([[0], np.cumsum([len(x) for x in numbers])]).astype(np.int64)
        p = np.array([x for part in numbers for x in part] or [0.0])
        codes = np.array([CODES[n] for n in names], dtype=np.int64)
        rubs = bool(np.any(codes // 100 == 1)) if names else False
        y, rest = self._begin(zo, int(zo[-1]), number)
        times = excitation.times(self.step_s)
        asked = excitation.torque(times)
        motion, parts = np.empty((len(times), 4)), np.zeros((len(times), max(1, len(names))))
        peak = 400.0 * math.pi / 180.0
        substeps = substeps or max(1, math.ceil(self.step_s * self._fastest(peak) / STEP_RAD))
        late = self.effects.get("torque_delay", {}).get("delay", 0.0)
        kind = excitation.kind
        good = integrator.run(
            y, len(times) - 1, self.step_s, substeps, 0.0 if rubs else 1.0,
            np.array([self.inertia, self.damping, self.stiffness]), codes, zo[:-1], po[:-1], so[:-1], p,
            np.ones(int(so[-1])), late, kind, excitation.array, excitation.tones, rubs, motion, parts,
        )  # fmt: skip
        if not good:
            raise Diverged(f"{excitation.name}: the angle left all bounds")
        angle = motion[:, 0] - (rest if self.channel == "rate" else 0.0)
        sensed = self._sensed(times, motion[:, 3], number)
        return Record(times, asked, angle, motion[:, 1], sensed, parts[:, : len(names)])

    def _sensed(self, times: Any, rate: Any, number: int) -> Any:
        """What a gyro free of noise makes of the rate behind its lag."""
        out = np.array(rate)
        if "cubic_gyro" in self.effects:
            out = out + self.effects["cubic_gyro"]["factor"] * out**3
        if "aliased_vibration" in self.effects:
            v = self.effects["aliased_vibration"]
            phase = self._phase(number)
            slow = v["wander"] / 0.35 * np.sin(2.0 * math.pi * 0.35 * times + 2.0 * phase)  # cycles gained and lost
            out = out + v["amplitude"] * np.sin(2.0 * math.pi * (v["frequency"] * times + slow) + phase)
        return out + self.bias + self.effects.get("rate_bias", {}).get("bias", 0.0)

    def measured(self, record: Record, rng: np.random.Generator) -> Any:
        """The channel with its noise, shape (n,)."""
        true = record.sensed_rate_rad_s if self.channel == "rate" else record.angle_rad
        return true + self.noise * rng.standard_normal(len(true))
