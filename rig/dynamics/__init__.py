"""Motion of the platform: the equation of motion with its effects, integrated accurately."""

from rig.dynamics.equations import Equations
from rig.dynamics.grid import Grid, Motion, simulate
from rig.dynamics.stepper import Stepper
from rig.dynamics.tangent import Tangent, smooth
from rig.dynamics.torque import NO_TORQUE, TorqueSignal

__all__ = ["NO_TORQUE", "Equations", "Grid", "Motion", "Stepper", "Tangent", "TorqueSignal", "simulate", "smooth"]
