"""What a little more of any parameter, start state or torque adds to a simulated run, without simulating it anew."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from identify.model.effect_torque import torque_along
from identify.simulate.shots import Shots, motion, read_off
from rig import effects
from rig.dynamics import Equations, Tangent, smooth
from rig.recording.run import Array

MAX_COEFFICIENTS = 8_000_000  # numbers in the coefficients of one run: beyond, simulations cost less than room


class Neighbourhood:
    """The runs beside a simulated one, to first order.

    Attributes
    ----------
    channel
        The measured channel as the model gives it, (n,).
    half
        Angle, rate, time and torque at start, middle and end of every fine step, (2 m + 1,) each.
    """

    def __init__(self, shots: Shots, equations: Equations) -> None:
        self._shots, self._equations = shots, equations
        self._moving = motion(shots, equations, shots.starts)
        fine, torque, spans, starts = self._moving
        self.channel = self._read(fine[:, :2])
        begin_s = shots.trace.since_start_s
        self._tangent = Tangent(equations, fine, torque, shots.grid.step_s, spans, starts, begin_s, shots.trace)

    @cached_property
    def half(self) -> tuple[Array, Array, Array, Array]:
        """At start, middle and end of every fine step."""
        fine, torque, middle = self._moving.fine, self._moving.torque, self._tangent.middle
        angle, rate, pushed = (np.empty(2 * len(torque) + 1) for _ in range(3))
        angle[::2], rate[::2], pushed[:-1:2], pushed[-1] = fine[:, 0], fine[:, 1], torque[:, 0], torque[-1, 2]
        angle[1::2], rate[1::2], pushed[1::2] = middle[:, 0], middle[:, 1], torque[:, 1]
        begin = 2 * self._moving.first
        angle[:begin], rate[:begin] = angle[begin], 0.0  # at rest where nothing was simulated
        time = self._shots.trace.since_start_s + 0.5 * self._shots.grid.step_s * np.arange(len(angle))
        return angle, rate, time, pushed

    def resisted(self, push: Array) -> Array:
        """What a torque, (m, 3), that resists besides adds to the channel, (n,)."""
        return self._seen(self._tangent.moved(-push))

    def begun(self, k: int) -> Array:
        """What a unit more of angle (0) or rate (1) at every start adds to the channel, (n,)."""
        return self._seen(self._tangent.moved(None, (1.0, 0.0) if k == 0 else (0.0, 1.0)))

    def changed(self, other: Equations) -> Array | None:
        """What other parameters of the same effects add, (n,); None where internal states feel them."""
        mine = self._equations
        push = self._platform_of(other)
        if other.drive.values != mine.drive.values:
            push = push + self._moving.torque - self._shots.grid.shaft_torque(other)
        for k, name in enumerate(mine.body):
            at = slice(int(mine.p_at[k]), int(mine.p_at[k + 1]))
            own = slice(at.start + 3, at.stop)
            leans = effects.get(name).leans_on and not np.array_equal(mine.p[at], other.p[at])
            if not leans and np.array_equal(mine.p[own], other.p[own]):
                continue
            if effects.get(name).states:
                return None
            difference = self._torque(name, other, at) - self._torque(name, mine, at)
            push = push + np.stack([difference[:-1:2], difference[1::2], difference[2::2]], axis=1)
        out = self.resisted(push) if isinstance(push, np.ndarray) else np.zeros_like(self.channel)
        if other.sensor.values != mine.sensor.values:
            fine = self._moving.fine[:, :2]
            out = out + read_off(self._shots, other, fine, self._moving.first, self._shots.bias) - self.channel
        return out

    def _platform_of(self, other: Equations) -> Array | float:
        """The torque by which other J, C and K resist the motion besides; zero where they are the same."""
        inertia, damping, stiffness = (other.jck - self._equations.jck).tolist()
        if not (inertia or damping or stiffness):
            return 0.0
        fine, tangent = self._moving.fine, self._tangent
        columns = [(tangent.begin, fine[:-1]), (tangent.middle[:, 2], tangent.middle), (tangent.end, fine[1:])]
        return np.stack([inertia * a + damping * x[:, 1] + stiffness * x[:, 0] for a, x in columns], axis=1)

    def _torque(self, name: str, equations: Equations, at: slice) -> Array:
        """The torque of an effect without states along the motion, at every half step."""
        values, _kept = equations.parameters_with(self._shots.trace)
        angle, rate, time, torque = self.half
        out = np.empty_like(angle)
        torque_along(
            effects.get(name).kernel.address, angle, rate, time, torque, 0.5 * self._shots.grid.step_s, np.zeros(0), 1,
            values[at].copy(), False, 1.0, out,
        )  # fmt: skip
        return out

    def _read(self, fine: Array) -> Array:
        return read_off(self._shots, self._equations, fine, self._moving.first, self._shots.bias)

    def _seen(self, by: Array) -> Array:
        """The channel of a motion beside this one, less its own: a gyro's bias is in both."""
        return self._read(self._moving.fine[:, :2] + by) - self.channel


def neighbourhood_of(shots: Shots, equations: Equations) -> Neighbourhood | None:
    """Of a run whose simulation costs more than that, and whose motion has one."""
    size = 2 + equations.states
    if (
        not np.any(shots.active)
        or not equations.loads
        or not smooth(equations)
        or size * (size + 3) * shots.grid.n > MAX_COEFFICIENTS
    ):
        return None
    return Neighbourhood(shots, equations)
