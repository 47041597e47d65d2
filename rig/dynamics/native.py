"""Bare addresses in compiled code: effects are called by address, and arrays passed without a reference count."""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from rig.effects.base import FILTER_SIGNATURE, KERNEL_SIGNATURE

jit = nb.njit(cache=True, error_model="numpy", nogil=True)


def addresses(kernels: list[Any]) -> Any:
    """Where compiled kernels live, as the compiled functions take them, shape (n,)."""
    return np.array([k.address for k in kernels], dtype=np.int64)


@intrinsic
def pointer(typingctx: Any, array: Any) -> Any:
    """Pointer to an array's first element. Passing arrays costs a reference count a call; pointers are free."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, args[0]).data

    return types.CPointer(array.dtype)(array), codegen


@intrinsic
def offset(typingctx: Any, pointer: Any, count: Any) -> Any:
    """Pointer to the element ``count`` behind ``pointer``."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.gep(args[0], [args[1]])

    return pointer(pointer, types.intp), codegen


@intrinsic
def floats_at(typingctx: Any, address: Any) -> Any:
    """Pointer to the float64 values at an address."""
    signature = types.CPointer(types.float64)(types.int64)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.DoubleType().as_pointer())

    return signature, codegen


@intrinsic
def integers_at(typingctx: Any, address: Any) -> Any:
    """Pointer to the int64 values at an address."""
    signature = types.CPointer(types.int64)(types.int64)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.IntType(64).as_pointer())

    return signature, codegen


@intrinsic
def call(typingctx: Any, address: Any, th: Any, w: Any, t: Any, m: Any, z: Any, dz: Any, p: Any) -> Any:
    """Call the kernel at an address."""
    signature = types.float64(types.int64, *KERNEL_SIGNATURE.args)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        double = ir.DoubleType()
        kind = ir.FunctionType(double, [double] * 4 + [double.as_pointer()] * 3)
        return builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])

    return signature, codegen


@intrinsic
def call_filter(typingctx: Any, address: Any, x: Any, h: Any, s: Any, p: Any) -> Any:
    """Call the filter kernel at an address."""
    signature = types.float64(types.int64, *FILTER_SIGNATURE.args)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        double = ir.DoubleType()
        kind = ir.FunctionType(double, [double] * 2 + [double.as_pointer()] * 2)
        return builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])

    return signature, codegen
