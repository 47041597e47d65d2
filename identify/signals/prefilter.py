"""The filter that turns an equation error into a prediction error (white where the model is right).

The equation error J a + C w + K th + effects - M is passed through s/D(s) (rate measured) or 1/D(s) (angle
measured). With sensor noise of density S_e, white in the measured channel, and a torque disturbance of
density S_d, the spectral factor of the total is

    rate:  |D|^2 = |J s^2 + C s + K|^2 + rho^2 w^2   ->  D = J s^2 + sqrt(C^2 + rho^2) s + K
    angle: |D|^2 = |J s^2 + C s + K|^2 + rho^2       ->  D = J s^2 + d1 s + sqrt(K^2 + rho^2)

with rho^2 = S_d / S_e. At rho = 0 this is the Steiglitz-McBride (SRIVC) filter and the residual is the
sensor's own noise; a large rho weighs the torque residual itself. (Steiglitz and McBride 1965; Young and
Jakeman 1980; Ljung, System Identification, 2nd ed., section 7.3.)

Inputs are piecewise polynomials in time and the response to them is exact: a hold or a bilinear transform
at 1 kHz is off by 0.3 % at 29 Hz.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numba as nb
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from rig.recording.run import Array


@dataclass(frozen=True)
class Denominator:
    """D(s) = inertia s^2 + damping s + stiffness."""

    inertia: float
    damping: float
    stiffness: float
    of_platform: bool = False  # or a low-pass that knows none

    @classmethod
    def of(cls, inertia: float, damping: float, stiffness: float, rho: float, rate_measured: bool) -> Denominator:
        """Spectral factor for a platform and a ratio of torque disturbance to sensor noise; always stable."""
        j, c, k = max(inertia, 1e-12), abs(damping), max(stiffness, 0.0)
        if rate_measured:
            return cls(j, float(np.hypot(c, rho)), k, True)
        d0 = float(np.hypot(k, rho))
        return cls(j, float(np.sqrt(max(c * c + 2.0 * j * (d0 - k), 0.0))), d0, True)

    def loaded(self, added_kg_m2: float) -> Denominator:
        """Of the same platform with a known inertia mounted: a run's residual is white behind its own factor only."""
        return replace(self, inertia=self.inertia + added_kg_m2) if self.of_platform and added_kg_m2 else self

    def transition(self, step_s: float) -> tuple[Array, Array]:
        """State transition (2, 2) and the response (2, 4) to 1, t, t^2, t^3 over one step."""
        return _transition(self, step_s)


@lru_cache(maxsize=256)
def _transition(d: Denominator, step_s: float) -> tuple[Array, Array]:
    a = np.zeros((6, 6))
    a[0, 1] = 1.0
    a[1, :3] = np.array([-d.stiffness, -d.damping, 1.0]) / d.inertia
    a[2, 3] = a[3, 4] = a[4, 5] = 1.0  # a chain of integrators makes t^k / k! of its k-th state
    e = expm(a * step_s)
    return e[:2, :2].copy(), np.ascontiguousarray(e[:2, 2:] * np.array([1.0, 1.0, 2.0, 6.0]))


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _respond(phi, gamma, pieces, first, last, stride, out):  # type: ignore[no-untyped-def]
    """1/D and s/D of a piecewise polynomial, from rest at piece ``first``; every stride-th instant kept."""
    x0, x1 = 0.0, 0.0
    order = pieces.shape[1]
    out[0, 0], out[0, 1] = 0.0, 0.0
    row = 1
    for i in range(first, last):
        y0 = phi[0, 0] * x0 + phi[0, 1] * x1
        y1 = phi[1, 0] * x0 + phi[1, 1] * x1
        for k in range(order):
            y0 += gamma[0, k] * pieces[i, k]
            y1 += gamma[1, k] * pieces[i, k]
        x0, x1 = y0, y1
        if (i + 1 - first) % stride == 0:
            out[row, 0], out[row, 1] = x0, x1
            row += 1


def smooth_pieces(values: Array, step_s: float) -> Array:
    """Cubic spline through uniform samples as polynomials, shape (n - 1, 4), lowest power first."""
    spline = CubicSpline(step_s * np.arange(len(values)), values)
    return np.ascontiguousarray(spline.c[::-1].T)


def linear_pieces(values: Array, step_s: float) -> Array:
    """Straight lines between uniform samples, shape (n - 1, 2): for signals with corners and jumps."""
    return np.ascontiguousarray(np.stack([values[:-1], np.diff(values) / step_s], axis=1))


def held_pieces(values: Array) -> Array:
    """Constants over each step, shape (n, 1)."""
    return np.ascontiguousarray(values[:, None])


class Prefilter:
    """The responses of one denominator at one step length."""

    def __init__(self, denominator: Denominator, step_s: float) -> None:
        self.denominator = denominator
        self.step_s = step_s

    def respond(self, pieces: Array, first: int, last: int, upsampling: int = 1) -> Array:
        """1/D and s/D of a signal at samples first..last, from rest at ``first``; shape (last - first + 1, 2)."""
        phi, gamma = self.denominator.transition(self.step_s / upsampling)
        out = np.empty((last - first + 1, 2))
        _respond(phi, gamma, pieces, first * upsampling, last * upsampling, upsampling, out)
        return out

    def free(self, count: int) -> Array:
        """The two motions that die away by themselves (unknown start state), shape (count, 2)."""
        out = np.empty((count, 2))
        phi = self.denominator.transition(self.step_s)[0]
        _decay(phi, out)
        return out


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _decay(phi, out):  # type: ignore[no-untyped-def]
    a, b, c, d = 1.0, 0.0, 0.0, 1.0
    for i in range(out.shape[0]):
        out[i, 0], out[i, 1] = a, b
        a, b, c, d = (
            phi[0, 0] * a + phi[0, 1] * c,
            phi[0, 0] * b + phi[0, 1] * d,
            phi[1, 0] * a + phi[1, 1] * c,
            phi[1, 0] * b + phi[1, 1] * d,
        )
