"""DC torque motor and its amplifier, direct or geared (Eq. 6, Fig. 2, 3), solved exactly over a fine step.

    L di/dt = u - R i - Ke w_m,   M_m = Kt i,   Ke = Kt (SI),   w_m = N w,   M = eta N M_m

While the voltage suffices, a current loop makes the current approach its reference with one pole at its
bandwidth and back-EMF does not show; at the voltage limit the equation above takes over with u = +-U. Under
voltage drive u = R i_ref always, so Kt^2/R of back-EMF damping acts on the shaft. The rate is taken as constant
over a fine step. The mean torque of the step is what the shaft feels and what the drive reports.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rig.arrays import Array
from rig.dynamics import native

if TYPE_CHECKING:
    from rig.config.simulated import MotorAmplifier

MotorState = Array
CURRENT, RESISTANCE, INDUCTANCE, CONSTANT, LIMIT_V, RATIO, TORQUE_PER_A, LOOP_RAD_S = range(8)


def motor_state(motor: MotorAmplifier) -> MotorState:
    """Parameters and current of a motor at rest, as the compiled step takes them, shape (8,)."""
    loop = 2.0 * math.pi * motor.bandwidth_hz if motor.control == "current" else 0.0
    per_ampere = motor.torque_constant_nm_a * motor.gear_ratio * motor.gear_efficiency
    return np.array(
        [
            0.0,
            motor.resistance_ohm,
            motor.inductance_h,
            motor.torque_constant_nm_a,
            motor.voltage_limit_v,
            motor.gear_ratio,
            per_ampere,
            loop,
        ]
    )


@native.jit
def _approach(i, goal, pole, h):  # type: ignore[no-untyped-def]
    """Current after h and its mean, on the way to a goal with one pole."""
    x = pole * h
    left = math.exp(-x)
    return goal + (i - goal) * left, goal + (i - goal) * (1.0 - left) / x


@native.jit
def motor_torque(motor, torque, rate, h):  # type: ignore[no-untyped-def]
    """Mean shaft torque over h when asked for ``torque`` at shaft rate ``rate``; updates the current."""
    i, r, inductance, kt, limit = motor[0], motor[1], motor[2], motor[3], motor[4]
    emf = kt * motor[5] * rate
    reference = torque / motor[6]
    loop = motor[7]
    if loop > 0.0:
        u = r * i + inductance * loop * (reference - i) + emf
        if abs(u) <= limit:
            motor[0], mean = _approach(i, reference, loop, h)
            return mean * motor[6]
    else:
        u = r * reference
    u = min(limit, max(-limit, u))
    end, mean = _approach(i, (u - emf) / r, r / inductance, h)
    if loop > 0.0 and (reference - i) * (end - reference) > 0.0:
        # The saturated stretch would run past the reference: the loop takes hold of it there.
        end, mean = reference, 0.5 * (i + reference)
    motor[0] = end
    return mean * motor[6]
