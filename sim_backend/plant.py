"""The simulated platform: the rig's own equation of motion, advanced one stretch of torque at a time.

The integrator is that of ``rig.dynamics``: fourth-order Runge-Kutta on a fine step, stick and slip located
as events. The torque enters on quarter steps, so that a continuous excitation is followed as a parabola and a
held one is exact; drive and sensor effects of the hidden truth sit in between, as in ``rig.dynamics.Grid``.
A call goes through bare addresses, as in ``rig.dynamics.Stepper``: passing the arrays would cost more than
the steps themselves.
"""

from __future__ import annotations

import numpy as np

from rig.arrays import Array
from rig.dynamics import Equations, integrator, native
from rig.dynamics.filters import through_filters
from rig.errors import ConfigError
from rig.platform import Platform
from sim_backend.motor import MotorState, motor_torque

ANGLE_COLUMN, RATE_COLUMN, SENSED_COLUMN, TORQUE_COLUMN = range(4)  # columns of what Plant.follow and its like return
RK4_PHASE_RAD = 0.03  # of the fastest motion in one fine step: leaves (0.03)^4 / 120, 7e-9, of a frequency
MAX_PARTS = 4096  # fine steps in a tick: a minute at 1 kHz takes some minutes then, and beyond that has no end
FOLLOW, HOLD, MOTOR = range(3)
_DRIVE, _SENSOR = 14, 20  # where the filter chains begin in the table of addresses


@native.jit
def _fine_steps(table, values, torque, motor, n, mode, out):  # type: ignore[no-untyped-def]
    """n fine steps; ``values`` holds the fine step, the asked torque and the shaft torque that was reached.

    ``torque`` has the quarter steps to follow, shape (4 n,). ``out`` takes rows of angle, rate, rate behind the
    sensor and torque asked of the drive effects.
    """
    motion, states, z, jck, body, work, saved, before, kinks, bends = integrator.laid_out(table)
    h = values[0]
    quarters = np.empty(4)
    for i in range(n):
        begin = values[2]
        asked = values[1] if mode != MOTOR else motor_torque(motor, values[1], motion[1], h)
        for k in range(4):
            if mode == FOLLOW:
                asked = torque[4 * i + k]
            quarters[k] = through_filters(asked, 0.25 * h, table, _DRIVE)
        middle = quarters[1]
        end = quarters[3]
        if mode != FOLLOW:  # the line that pushes as much as the quarters, and as early or late (rig.dynamics.grid)
            middle = 0.25 * (quarters[0] + quarters[1] + quarters[2] + quarters[3])
            rise = 0.2 * (3.0 * (quarters[3] - quarters[0]) + quarters[2] - quarters[1])
            begin = middle - rise
            end = middle + rise
        values[2] = quarters[3]
        integrator.step_over_kinks(
            motion, states, z, work, saved, h, begin, middle, end, jck, body, bends, kinks, before
        )
        out[i, 0] = motion[0]
        out[i, 1] = motion[1]
        out[i, 2] = through_filters(motion[1], h, table, _SENSOR)
        out[i, 3] = asked


_NOTHING = np.zeros(8)


class Plant:
    """A platform that is advanced by whole fine steps from rest.

    Parameters
    ----------
    platform
        The truth.
    coarsest_step_s
        The fine step is this divided by a whole number, small enough for the fastest motion.
    phase_rad
        How far the fastest motion turns in a fine step.
    """

    def __init__(self, platform: Platform, coarsest_step_s: float, phase_rad: float = RK4_PHASE_RAD) -> None:
        e = Equations(platform)
        needed = coarsest_step_s * e.fastest_rad_s() / phase_rad
        if not needed <= MAX_PARTS:
            raise ConfigError(
                f"simulated.platform: its fastest motion, {e.fastest_rad_s() / (2 * np.pi):.3g} Hz, takes "
                f"{needed:.3g} fine steps a tick, at most {MAX_PARTS} are simulated: raise the inertia, lower the "
                "stiffness, the damping or the steepest of its effects, or raise excitation.sample_rate_hz"
            )
        # A power of two, so that grids that halve each other nest and a held torque changes on all of them.
        self.parts = 1 << max(0, int(np.ceil(np.log2(needed) - 1e-9))) if needed > 1.0 else 1
        self.step_s = coarsest_step_s / self.parts
        self._values = np.array([self.step_s, 0.0, 0.0])
        self._out: Array = np.zeros((64, 4))
        motion, z, scratch = np.zeros(4), e.rest_states(0.0, 0.0), e.scratch()
        drive, sensor = e.drive.arrays(0.25 * self.step_s), e.sensor.arrays(self.step_s)
        self._kept = (e, motion, z, scratch, drive, sensor)  # the table holds bare addresses of these
        table = e.table(motion, z, scratch)
        for chain in (drive, sensor):
            table += [len(chain[0]), *(a.ctypes.data for a in chain)]
        self._table = np.array(table, dtype=np.int64)

    def _advance(self, torque: Array, motor: MotorState, n: int, mode: int) -> Array:
        if n > len(self._out):
            self._out = np.zeros((n, 4))
        _fine_steps(self._table, self._values, torque, motor, n, mode, self._out)
        return self._out

    def follow(self, torque_nm: Array) -> Array:
        """Advance under a smooth torque given at every quarter step after the present instant, shape (4 n,).

        Returns rows of angle, rate, rate behind the sensor effects and torque asked for at the end of each
        fine step, shape (n or more, 4); valid until the next call.
        """
        return self._advance(torque_nm, _NOTHING, len(torque_nm) // 4, FOLLOW)

    def hold(self, torque_nm: float, n: int) -> Array:
        """Advance n fine steps under a constant torque; rows as from ``follow``."""
        self._values[1] = torque_nm
        return self._advance(_NOTHING, _NOTHING, n, HOLD)

    def drive(self, torque_nm: float, n: int, motor: MotorState) -> Array:
        """Advance n fine steps behind a motor asked for a torque; the fourth column is its mean torque."""
        self._values[1] = torque_nm
        return self._advance(_NOTHING, motor, n, MOTOR)
