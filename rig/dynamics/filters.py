"""Chains of filter kernels, of a drive or a sensor: whole signals, or one sample at a time (compiled)."""

from __future__ import annotations

from rig.dynamics.native import call_filter, floats_at, integers_at, jit, offset, pointer


@jit
def run_filter(kernels, x, h, s, s_at, p, p_at):  # type: ignore[no-untyped-def]
    """Send the samples x (in place) through a chain of filter kernels, one after the other.

    A filter with memory starts as if its first sample had stood there for ever.
    """
    for k in range(len(kernels)):
        sk, pk = offset(pointer(s), s_at[k]), offset(pointer(p), p_at[k])
        x0 = x[0] if s_at[k + 1] > s_at[k] else 0.0
        for i in range(len(x)):
            x[i] = x0 + call_filter(kernels[k], x[i] - x0, h, sk, pk)
    return len(s) + len(p)


@jit
def through_filters(x, h, table, first):  # type: ignore[no-untyped-def]
    """One sample through the chain of filters whose count and addresses stand from table[first] on."""
    kernels, states, state_at = (
        integers_at(table[first + 1]), floats_at(table[first + 2]), integers_at(table[first + 3])
    )  # fmt: skip
    p, p_at = floats_at(table[first + 4]), integers_at(table[first + 5])
    for k in range(table[first]):
        x = call_filter(kernels[k], x, h, offset(states, state_at[k]), offset(p, p_at[k]))
    return x
