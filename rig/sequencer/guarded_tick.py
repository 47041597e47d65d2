"""One tick of the loop: check, exchange with the devices, record, check again; a fault takes the torque off first."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from rig.clock import Clock
from rig.errors import Aborted, DeviceFault, RigError, SafetyTrip
from rig.guard import Guard, Tick, Trip
from rig.interface import Rig
from rig.sequencer.held_torque import HeldTorque, Pulse
from rig.sequencer.recorder import SetRecorder


class GuardedTick:
    """Exchanges torque for samples under the guard.

    Parameters
    ----------
    rig, clock, guard
        The rig to play on, the clock that its samples are stamped by, and what to watch.
    stop
        Asked every tick; a text means: stop now, for this reason.

    Attributes
    ----------
    verdict_s
        The instant on the clock at which the first error was known, before anything was done about it; None so far.
    trip
        The broken limit, where one was.
    """

    def __init__(self, rig: Rig, clock: Clock, guard: Guard, stop: Callable[[], str | None]) -> None:
        self._rig, self._clock, self._guard, self._stop = rig, clock, guard, stop
        self.verdict_s: float | None = None
        self.trip: Trip | None = None
        self._held = HeldTorque()

    def pulses(self) -> list[Pulse]:
        """What late ticks did to the platform, seen from the verdict; none where there is no verdict."""
        return [] if self.verdict_s is None else self._held.pulses(self.verdict_s)

    def note_verdict(self) -> None:
        """The instant at which the first error was known; it ends up in the journal and in ``Campaign``."""
        if self.verdict_s is None:
            with contextlib.suppress(RigError):
                self.verdict_s = self._clock.now_s()

    def exchange(
        self, now_s: float, late_s: float, period_s: float, torque_nm: float, recorder: SetRecorder | None
    ) -> Tick:
        """One tick: permission, exchange, record, verdict."""
        reason = self._stop()
        if reason is not None:
            self.note_verdict()
            raise Aborted(f"{reason}: torque is off; what was recorded until then is kept.")
        trip = self._guard.permit(torque_nm, now_s, late_s)
        if trip is not None:
            raise self._tripped(trip)
        self._held.take(now_s, late_s, period_s, torque_nm)
        try:
            reply = self._rig.exchange(now_s, torque_nm)
        except BaseException as error:
            self.note_verdict()
            stall = self._stall_behind(error, now_s, late_s)
            if stall is None:
                raise
            raise stall from None
        tick = Tick(now_s, late_s, period_s, torque_nm, reply.gyro, reply.torque, reply.channels)
        if recorder is not None:
            recorder.take(tick)
        trip = self._guard.look(tick)
        if trip is not None:
            raise self._tripped(trip)
        return tick

    def _stall_behind(self, error: BaseException, now_s: float, late_s: float) -> SafetyTrip | None:
        """The stall that a fault followed from: a drive that has heard nothing meanwhile complains of just that."""
        if not isinstance(error, DeviceFault) or self.verdict_s is None:
            return None
        trip = self._guard.permit(0.0, now_s, late_s + self.verdict_s - now_s)
        return None if trip is None else SafetyTrip(f"{self._tripped(trip)} Consequence: {error}")

    def _tripped(self, trip: Trip) -> SafetyTrip:
        self.note_verdict()
        self.trip = trip
        try:
            self._rig.torque_off()  # the shortest road: before anything is formatted or written
        except RigError as fault:
            return SafetyTrip(f"Tripped on {trip} Torque off could not be sent: {fault}")
        return SafetyTrip(f"Torque is off. Tripped on {trip}")
