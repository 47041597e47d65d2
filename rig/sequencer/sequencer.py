"""The sequencer: plays the planned sets on a rig, tick by tick against absolute deadlines.

It knows neither the kind of rig nor the kind of clock. Torque is computed from the time of the tick, never
from its number, so a late tick sends the torque that belongs to its instant and a missed one is skipped.
Every way out takes the torque off first, then disarms, then closes; what was recorded is kept.
"""

from __future__ import annotations

import contextlib
import gc
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rig.clock import Clock
from rig.errors import Aborted, DeviceFault, RigError, SafetyTrip
from rig.excitation import PlannedSet
from rig.guard import Guard, Rest
from rig.interface import Rig
from rig.platform import Platform
from rig.recording.journal import Journal
from rig.recording.retiming import NO_RETIMING
from rig.recording.run import Recording
from rig.sequencer.guarded_tick import GuardedTick
from rig.sequencer.observer import Observer, Progress
from rig.sequencer.probe import Probe
from rig.sequencer.recorder import SetRecorder, SetStatistics
from rig.sequencer.time_corrections import log_time_corrections

__all__ = ["Campaign", "Observer", "Progress", "Sequencer"]

SETTLE_S = 0.5  # zero torque before the first set: the gyro's bias is read here
TAIL_S = 0.05  # zero torque after a set, for samples still on their way
REST_PERIOD_S = 0.01  # ticks of zero torque may be slower; they still feed the drive's watchdog
BIAS_WINDOW_S = 1.0  # of a rest, at its end
PROGRESS_S = 0.1  # between two reports to the observer: ten a second is what an eye follows
RING_CHECK_S = 0.25  # after the probe: how often to ask whether the ring has died out
# Standstill after the probe: no sample of the last RING_CHECK_S is faster than the larger of the two. Noise alone
# exceeds six standard deviations in one of a million looks (500 samples). 0.5 deg/s is where the guard takes a platform
# to move (MOVES_RAD_S); the paper's platform (29 Hz) then swings by 0.003 deg. More lets a set begin while the platform
# rings (tests/rig/sequencer fails at 4 deg/s), less waits for longer, at most for a rest.
STANDSTILL_SIGMAS, STANDSTILL_RAD_S = 6.0, math.radians(0.5)


@dataclass(frozen=True)
class Campaign:
    """What came of playing: all runs so far, how each set went, and the error that ended it early, if any.

    ``verdict_s`` is the instant of that error on the sequencer's clock: before anything was done about it.
    """

    recording: Recording
    statistics: tuple[SetStatistics, ...]
    cause: RigError | None = None
    verdict_s: float | None = None

    @property
    def aborted(self) -> bool:
        """Whether the campaign ended before its last set was complete."""
        return self.cause is not None


class Sequencer:
    """Plays sets on a rig.

    Parameters
    ----------
    rig, clock, guard
        The rig to play on, the clock that its samples are stamped by, and what to watch.
    sample_rate_hz
        Ticks a second while a set plays.
    rest_s
        Zero torque between sets.
    journal
        Where samples go as they come, or None.
    stop
        Asked every tick; a text means: stop now, for this reason. Set by a signal handler, say.
    probe
        Small pulses before the first set, or None for none.
    keep_runs
        Whether runs stay in memory; where they do not, the journal has them, and a long campaign needs no more
        memory than a short one.
    declared
        The platform that the pre-flight predicted with; a trip then says where it may be wrong.
    """

    def __init__(
        self,
        rig: Rig,
        clock: Clock,
        guard: Guard,
        *,
        sample_rate_hz: float,
        rest_s: float,
        journal: Journal | None = None,
        observer: Observer | None = None,
        stop: Callable[[], str | None] = lambda: None,
        probe: Probe | None = None,
        keep_runs: bool = True,
        declared: Platform | None = None,
    ) -> None:
        self._rig = rig
        self._clock = clock
        self._guard = guard
        self._period_s = 1.0 / sample_rate_hz
        self._rest_s = rest_s
        self._journal = journal
        self._observer = observer or Observer()
        self._probe, self._keep_runs, self._declared = probe, keep_runs, declared
        self._guarded = GuardedTick(rig, clock, guard, stop)
        self._recorders: list[SetRecorder] = []
        self._statistics: list[SetStatistics] = []
        self._still: deque[tuple[float, float]] = deque()

    def play(self, sets: Sequence[PlannedSet]) -> Campaign:
        """Play all sets; returns what was recorded, also after a trip, a fault or Ctrl-C (see ``cause``).

        Any other exception passes through once torque is off; the journal then has the samples.
        """
        cause: RigError | None = None
        self._recorders, self._statistics = [], []
        begun = 0
        try:
            with _without_garbage_collection(), self._rig.opened(), self._rig.armed():
                self._guard.begin(self._clock.now_s(), Rest())
                self._hold_zero(SETTLE_S, REST_PERIOD_S)
                self._guard.origin()
                self._play_probe()
                for number, planned in enumerate(sets, 1):
                    if number > 1:
                        self._hold_zero(self._rest_s, REST_PERIOD_S)
                    self._observer.set_begins(planned, number, len(sets))
                    begun = number
                    self._play_set(planned)
        except KeyboardInterrupt:
            cause = Aborted("Stopped by Ctrl-C: torque is off; what was recorded until then is kept.")
        except RigError as error:
            trip, pulses = self._guarded.trip, self._guarded.pulses()  # all is closed: there is time to look at why
            from rig.sequencer.declared_motion import explained  # noqa: PLC0415  # slow to load

            cause = explained(_with_context(error), trip, pulses, self._declared, sets[:begun], self._rest_s)
        if cause is not None and self._journal is not None:
            with contextlib.suppress(RigError):
                self._journal.event(self._now_s(), str(cause), {"aborted": True, "verdict_s": self._guarded.verdict_s})
        better = log_time_corrections(self._rig, self._journal, self._now_s)
        info = {"backend": str(self._rig.statement()), "aborted": str(cause) if cause else None}
        played = (one.run(better.get(one.start_s, NO_RETIMING)) for one in self._recorders)
        runs = tuple(run for run in played if run is not None)
        recording = Recording(runs, noise=self._rig.noise_rad_s, info=info)
        return Campaign(recording, tuple(self._statistics), cause, self._guarded.verdict_s)

    def _now_s(self) -> float:
        """For what is said on the way out: a replay has no more time to give."""
        try:
            return self._clock.now_s()
        except RigError:
            return self._guarded.verdict_s or 0.0

    def _play_probe(self) -> None:
        """Small pulses and what they tell, then rest until the platform is still. Raises SafetyTrip."""
        probe = self._probe
        if probe is None:
            return
        rest = self._resting()
        probe.begin(rest)
        start_s = self._clock.now_s() + self._period_s
        self._guard.begin(start_s, rest)
        tick = 0
        while not probe.over:
            deadline_s = start_s + tick * self._period_s
            now_s = self._clock.wait_until(deadline_s)
            at_s, late_s = now_s - start_s, now_s - deadline_s
            seen = self._guarded.exchange(now_s, late_s, self._period_s, probe.torque(at_s), None)
            probe.take(at_s, start_s, seen)
            tick += 1 + int(late_s / self._period_s + 1e-9)
        try:
            finding = probe.finding()
        except SafetyTrip:
            self._guarded.note_verdict()
            raise
        now_s = self._clock.now_s()
        self._observer.probed(finding)
        if self._journal is not None:
            self._journal.event(now_s, finding, {"probe": True})
        self._until_still(rest)

    def _until_still(self, rest: Rest) -> None:
        """Zero torque until nothing moves any more, at most as long as a rest."""
        still_rad_s = max(STANDSTILL_SIGMAS * rest.noise_rad_s, STANDSTILL_RAD_S)
        left_s = max(self._rest_s, SETTLE_S)
        while left_s > 0.0:
            self._hold_zero(min(RING_CHECK_S, left_s), REST_PERIOD_S)
            left_s -= RING_CHECK_S
            if all(abs(rate - rest.bias_rad_s) < still_rad_s for _, rate in self._still):
                break
        self._hold_zero(SETTLE_S, REST_PERIOD_S)

    def _play_set(self, planned: PlannedSet) -> None:
        start_s = self._clock.now_s() + self._period_s
        rest = self._resting()
        self._guard.begin(start_s, rest)
        rig, bias = self._rig, rest.bias_rad_s
        recorder = SetRecorder(
            planned, start_s, rig.torque_hold, self._journal, rig.rate_low_pass, self._keep_runs, bias
        )
        complete = False
        try:
            self._rig.begin_set(planned.torque, start_s)
            self._ticks(planned, recorder, start_s)
            self._hold_zero(TAIL_S, self._period_s, recorder)
            complete = True
        except BaseException:
            with contextlib.suppress(RigError):  # the fault that is under way is the one to report
                self._rig.torque_off()
            raise
        finally:
            self._rig.end_set()
            self._keep(recorder, complete)

    def _ticks(self, planned: PlannedSet, recorder: SetRecorder, start_s: float) -> None:
        """The set itself: from its first tick to the one that takes the torque off."""
        period_s, duration_s = self._period_s, planned.duration_s
        tick, reported_s, playing = 0, -math.inf, True
        while playing:
            deadline_s = start_s + tick * period_s
            now_s = self._clock.wait_until(deadline_s)
            at_s = now_s - start_s
            playing = at_s < duration_s - 1e-6
            torque_nm = float(planned.torque(at_s)) if playing else 0.0
            late_s = now_s - deadline_s
            self._guarded.exchange(now_s, late_s, period_s, torque_nm, recorder)
            tick += 1 + int(late_s / period_s + 1e-9)
            if at_s - reported_s >= PROGRESS_S:
                reported_s = at_s
                self._tell(planned, recorder, at_s)

    def _hold_zero(self, duration_s: float, period_s: float, recorder: SetRecorder | None = None) -> None:
        """Zero torque for a while, guarded, the gyro listened to for its bias."""
        begin_s = self._clock.now_s()
        deadline_s = begin_s
        still = self._still
        if recorder is None:
            still.clear()
        while deadline_s < begin_s + duration_s - 1e-9:
            deadline_s += period_s
            now_s = self._clock.wait_until(deadline_s)
            late_s = now_s - deadline_s
            tick = self._guarded.exchange(now_s, late_s, period_s, 0.0, recorder)
            deadline_s += period_s * int(late_s / period_s + 1e-9)
            still.extend((time_s, rate) for time_s, rate, valid in tick.gyro if valid)
            while still and still[0][0] < now_s - BIAS_WINDOW_S:
                still.popleft()

    def _resting(self) -> Rest:
        """Bias of the gyro over the end of the last rest, and how sure it is."""
        rates = np.array([rate for _, rate in self._still])
        if len(rates) < 2:
            return Rest()
        noise = float(rates.std())
        return Rest(float(rates.mean()), noise / math.sqrt(len(rates)), noise)

    def _tell(self, planned: PlannedSet, recorder: SetRecorder, at_s: float) -> None:
        r = recorder
        figures = (r.late_max_s, r.missed_ticks, r.drops, r.peak_torque_nm)
        self._observer.progress(Progress(planned.name, at_s, planned.duration_s, *figures))

    def _keep(self, recorder: SetRecorder, complete: bool) -> None:
        """Keep the set; a journal that fails on the way out of an error must not hide that error."""
        if self._keep_runs:
            self._recorders.append(recorder)
        statistics = recorder.statistics(complete)
        self._statistics.append(statistics)
        self._observer.set_ends(statistics)
        with contextlib.nullcontext() if complete else contextlib.suppress(RigError):
            recorder.close(complete)


def _with_context(error: RigError) -> RigError:
    """A fault while disarming after another error: both matter, the fault decides the exit code; none is told twice."""
    earlier = error.__context__
    is_repeated = bool(str(earlier)) and str(earlier) in str(error)
    if isinstance(error, DeviceFault) and isinstance(earlier, (RigError, KeyboardInterrupt)) and not is_repeated:
        return DeviceFault(f"{error} This happened while handling: {earlier or 'Ctrl-C'}")
    return error


@contextlib.contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """A pause of the garbage collector is a missed tick; nothing in the loop makes reference cycles."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
