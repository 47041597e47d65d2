"""The equation of motion one step at a time, for whoever plays a platform tick by tick."""

from __future__ import annotations

import numpy as np

from rig.dynamics import integrator
from rig.dynamics.equations import Equations
from rig.platform import Platform


class Stepper:
    """The same equations, one fine step at a time: for a rig that is played tick by tick."""

    def __init__(self, platform: Platform, step_s: float) -> None:
        self.equations = Equations(platform)
        self.step_s = step_s
        self.substeps = self.equations.substeps(step_s) if self.equations.fastest_rad_s() > 0 else 1
        self.reset()

    def reset(self, angle_rad: float = 0.0, rate_rad_s: float = 0.0) -> None:
        """Put the platform at an angle and a rate, all memory of the past forgotten, time zero."""
        e = self.equations
        fine_s = self.step_s / self.substeps
        motion = np.array([angle_rad, rate_rad_s, np.sign(rate_rad_s), 0.0])
        z = e.rest_states(angle_rad, rate_rad_s)
        scratch = e.scratch()
        drive, sensor = e.drive.arrays(fine_s), e.sensor.arrays(fine_s)
        self._kept = (motion, z, scratch, drive, sensor)  # the table below holds bare addresses of these
        table = e.table(motion, z, scratch, self.substeps)
        for chain in (drive, sensor):
            table += [len(chain[0]), *(a.ctypes.data for a in chain)]
        self._table = np.array(table, dtype=np.int64)
        self._values = np.array([fine_s, 0.0, 0.0, angle_rad, rate_rad_s, rate_rad_s, 0.0])

    def advance(self, torque_start_nm: float, torque_end_nm: float) -> tuple[float, float, float, float]:
        """One step under a torque that runs linearly between two values (equal: held).

        Returns
        -------
        angle_rad, rate_rad_s, sensed_rate_rad_s, shaft_torque_nm
            At the end of the step.
        """
        self._values[1], self._values[2] = torque_start_nm, torque_end_nm
        integrator.advance(self._table, self._values)
        _, _, _, angle, rate, sensed, shaft = self._values.tolist()
        return angle, rate, sensed, shaft
