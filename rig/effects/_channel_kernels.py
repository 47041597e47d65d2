"""The compiled kernels of measured channels, one for each way in which a channel may act.

Loading them takes as long as a forecast, and most configurations have no channel: ``_channels`` asks for them by name.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from rig.effects.base import kernel


@intrinsic
def _floats(typingctx: Any, address: Any) -> Any:
    """Pointer to the float64 values at an address."""
    signature = types.CPointer(types.float64)(types.int64)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.DoubleType().as_pointer())

    return signature, codegen


@nb.njit(error_model="numpy")
def _reading(time, p):  # type: ignore[no-untyped-def]
    """What the channel reads at a time, straight between the entries of its table, constant beyond its ends."""
    table, count = _floats(np.int64(p[4])), np.int64(p[6])
    place = min(max((time - p[7]) * p[5], 0.0), count - 1.0)
    i = min(np.int64(place), count - 2)
    return table[i] + (place - i) * (table[i + 1] - table[i])


@kernel
def torque_of(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * _reading(time, p)


@kernel
def stiffness_of(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * _reading(time, p) * angle


@kernel
def damping_of(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * _reading(time, p) * rate


@kernel
def gain_of(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return -p[3] * _reading(time, p) * torque


@kernel
def drive_of(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * (torque - _reading(time, p))
