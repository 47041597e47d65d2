"""How a run finds the platform: what the runs before it left in the memory of its effects, and how long it rings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identify.proof.drive import Drive
from rig import effects
from rig.arrays import Array
from rig.dynamics import Equations, Motion, TorqueSignal, simulate
from rig.excitation import PlannedSet
from rig.platform import Platform

# Of the noise: peak of the ring that may be left when the next run begins. It decays from there, so that over a set it
# adds less than an eighth to the power of the noise.
RING_LEFT = 0.5
MAX_REST_S = 120.0  # a rest that is longer is the user's to ask for
AT_ONCE_S = 4.0  # of a rest, simulated: a fast mode needs many fine steps, and their torque memory
Moving = tuple[float, float]  # angle in rad and rate in rad/s


@dataclass(frozen=True)
class Standing:
    """A platform that stands still before a run.

    Parameters
    ----------
    angle_rad
        Where its spring holds it against what its effects pull there.
    states
        Their internal states, end to end as ``Equations`` has them.
    """

    angle_rad: float
    states: Array

    @classmethod
    def untouched(cls, platform: Platform) -> Standing:
        """Of a platform that nothing has moved yet."""
        equations = Equations(platform)
        angle_rad = equations.rest_angle_rad()
        return cls(angle_rad, equations.rest_states(angle_rad, 0.0))

    def of(self, platform: Platform, name: str) -> Array:
        """The states of one effect."""
        equations = Equations(platform)
        if name not in equations.body:
            return np.zeros(0)
        first, last = equations.z_at[(i := equations.body.index(name)) : i + 2]
        return np.array(self.states[first:last])

    def after(self, planned: PlannedSet, platform: Platform, drive: Drive, rest_s: float) -> Standing:
        """How it stands once a set has been played and the rest is over, by the platform's own account.

        A loop that follows the angle (hysteresis, presliding friction) keeps what the last large reversals left.
        """
        states = self.states.copy()
        moving = _played(planned, platform, drive, self.angle_rad, states)
        for _ in _free(platform, moving, states, drive.tick_s, min(rest_s, MAX_REST_S)):
            pass  # only what it leaves is asked for
        if not np.all(np.isfinite(states)):
            return Standing.untouched(platform)
        return Standing(Equations(platform).rest_angle_rad(states), states)


def remembers(platform: Platform) -> bool:
    """Whether an effect keeps, however long a platform rests, what moved it before."""
    return any(effects.get(name).follows_within_rad is not None for name in platform.effects)


@dataclass(frozen=True)
class Standings:
    """How each of several models stands before a run; ``rest_s`` is how long it rests after one."""

    models: Mapping[str, Platform]
    drive: Drive
    rest_s: float
    found: Mapping[str, Standing]

    @classmethod
    def untouched(cls, models: Mapping[str, Platform], drive: Drive, rest_s: float) -> Standings:
        """Before anything has moved."""
        return cls(models, drive, rest_s, {name: Standing.untouched(model) for name, model in models.items()})

    def after(self, planned: PlannedSet) -> Standings:
        """The same after a set and its rest."""
        found = {
            name: self.found[name].after(planned, model, self.drive, self.rest_s) if remembers(model)
            else self.found[name]
            for name, model in self.models.items()
        }  # fmt: skip
        return Standings(self.models, self.drive, self.rest_s, found)


def _played(planned: PlannedSet, platform: Platform, drive: Drive, angle_rad: float, states: Array) -> Moving:
    """How a set leaves a platform; ``states`` are left as at its end."""
    time_s = drive.tick_s * np.arange(round(planned.duration_s / drive.tick_s) + 1)
    torque_nm = drive.played(np.asarray(planned.torque(time_s), dtype=float))
    with np.errstate(all="ignore"):
        motion = simulate(
            platform, time_s, TorqueSignal(time_s, torque_nm, drive.hold), (angle_rad, 0.0), states=states
        )
    return float(motion.angle_rad[-1]), float(motion.rate_rad_s[-1])


def _free(platform: Platform, moving: Moving, states: Array, tick_s: float, free_s: float) -> Iterator[Motion]:
    """Its motion without torque from there, some seconds at a time; ``states`` are left as at the end of each."""
    left = round(free_s / tick_s)
    while left > 0:
        count = min(left, math.ceil(AT_ONCE_S / tick_s))
        with np.errstate(all="ignore"):
            motion = simulate(platform, tick_s * np.arange(count + 1), None, moving, states=states)
        yield motion
        moving = float(motion.angle_rad[-1]), float(motion.rate_rad_s[-1])
        left -= count


def rest_needed_s(
    sets: Sequence[PlannedSet], platform: Platform, drive: Drive, angle: bool, noise: float, rest_s: float
) -> float:
    """How long a platform has to rest after these sets until its ring is lost in the noise; at least ``rest_s``.

    The ring of J, C and K alone does no harm, for the linear model begins a run as it is found. That of an effect with
    states of its own (a flexible mode) is another than the linear model's, and no compensation knows its phase.
    """
    standing = Standing.untouched(platform)
    if not len(standing.states) or not platform.stiffness_nm_rad > 0.0:
        return rest_s
    needed_s = rest_s
    for planned in sets:
        states, rung_s, begun_s = standing.states.copy(), 0.0, 0.0
        moving = _played(planned, platform, drive, standing.angle_rad, states)
        for motion in _free(platform, moving, states, drive.tick_s, MAX_REST_S):
            stands_rad = Equations(platform).rest_angle_rad(states)
            seen = motion.angle_rad - stands_rad if angle else motion.sensed_rate_rad_s
            above = np.flatnonzero(np.abs(seen) > RING_LEFT * noise)
            if not len(above) or not np.all(np.isfinite(seen)):
                break
            rung_s = begun_s + drive.tick_s * float(above[-1] + 1)
            begun_s += drive.tick_s * (len(seen) - 1)
        needed_s = max(needed_s, rung_s)
    return min(needed_s, max(rest_s, MAX_REST_S))
