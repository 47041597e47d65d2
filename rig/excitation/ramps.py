"""Slow torques: push, hold and release (quasi-static stiffness, friction, creep), and let go (free decay)."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from rig.excitation.base import ExcitationSet, NotNegative, Positive, rise


class RampHoldRelease(ExcitationSet):
    """Torque rises smoothly, holds and returns as smoothly, ``cycles`` times with alternating sign."""

    kind: Literal["ramp_hold_release"]
    """Rises, holds and returns, with alternating sign."""
    torque_nm: float
    """Torque that is held, N m."""
    ramp_s: Positive = 2.0
    """Time of the rise, s."""
    hold_s: NotNegative = 1.0
    """Time at the full torque, s."""
    release_s: Positive = 2.0
    """Time of the return, s."""
    cycles: Annotated[int, Field(ge=1, le=1000)] = 1
    """Number of cycles, each with the other sign."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        needed = self.cycles * (self.ramp_s + self.hold_s + self.release_s)
        if needed > self.duration_s * (1.0 + 1e-9):
            raise ValueError(
                f"cycles x (ramp_s + hold_s + release_s) takes {needed:g} s but duration_s is "
                f"{self.duration_s:g}: lengthen duration_s or shorten the others"
            )
        return self

    def describe(self) -> str:
        """ "ramp 80 N m"."""
        return f"ramp {self.torque_nm:g} N m"

    def shape(self, time_s: Any) -> Any:
        """Torque in N m."""
        period = self.ramp_s + self.hold_s + self.release_s
        cycle = time_s // period
        t = time_s - cycle * period
        push = rise(t / self.ramp_s) - rise((t - self.ramp_s - self.hold_s) / self.release_s)
        return self.torque_nm * push * (1.0 - 2.0 * (cycle % 2.0)) * (cycle < self.cycles)


class FreeDecay(ExcitationSet):
    """Pull slowly to a torque, hold, let go: the rest is the platform's own ring."""

    kind: Literal["free_decay"]
    """Pulls slowly, holds and lets go."""
    torque_nm: float
    """Torque that is held, N m."""
    pull_s: Positive = 2.0
    """Time of the pull, s."""
    hold_s: NotNegative = 0.5
    """Time at the full torque, s."""
    release_s: Annotated[float, Field(ge=0.005)] = 0.01
    """Time of letting go, s."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        busy = self.pull_s + self.hold_s + self.release_s
        if busy >= self.duration_s:
            raise ValueError(
                f"pull_s + hold_s + release_s takes {busy:g} s and leaves nothing of duration_s = "
                f"{self.duration_s:g} for the decay: lengthen duration_s"
            )
        return self

    def describe(self) -> str:
        """ "free decay from 80 N m"."""
        return f"free decay from {self.torque_nm:g} N m"

    def shape(self, time_s: Any) -> Any:
        """Torque in N m."""
        let_go = rise((time_s - self.pull_s - self.hold_s) / self.release_s)
        return self.torque_nm * (rise(time_s / self.pull_s) - let_go)
