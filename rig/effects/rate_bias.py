"""Rate bias: the zero error of the gyro, fitted in every run and never reported as a missing effect."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, filter_kernel


@filter_kernel
def _bias(x, step, state, p):  # type: ignore[no-untyped-def]
    return x + p[0]


EFFECT = Effect(
    name="rate_bias",
    family="sensor",
    place=Place.SENSOR,
    equation="measured rate = w + bias",
    source="zero-rate output of a gyroscope (IEEE Std 952)",
    meaning="The gyro reads a rate at standstill.",
    sign="Added to the true rate.",
    parameters=(
        Parameter("bias", "rad/s", "zero-rate output", linear=True, low=-float("inf"), suffix="rad_s", per_run=True),
    ),
    kernel=_bias,
    stays="it changes the measurement, not the motion",
)
