"""Motion of the platform: the equation of motion with its effects, integrated accurately."""

from rig.dynamics.simulate import Equations, Grid, Motion, Stepper, simulate
from rig.dynamics.torque import NO_TORQUE, TorqueSignal

__all__ = ["NO_TORQUE", "Equations", "Grid", "Motion", "Stepper", "TorqueSignal", "simulate"]
