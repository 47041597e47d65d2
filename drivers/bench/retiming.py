"""Corrected time stamps of the sets of a bench, after the campaign."""

from __future__ import annotations

from drivers.amplifiers.base import Amplifier
from drivers.gyroscopes.base import Gyroscope
from drivers.timing.retiming import ClockRetiming, RetimedSet
from rig.config.bench import AmplifierConfig
from rig.interface import Correction, ExpectedDelay, StampPoints

NO_POINTS: StampPoints = ((), ())


def takes_reported(config: AmplifierConfig, amplifier: Amplifier) -> bool:
    """Whether the torque recorded is what the drive reports rather than what was sent to it."""
    return config.torque_source == "actual" or (config.torque_source == "auto" and amplifier.stamps_torque)


class BenchRetiming:
    """Both clocks of a bench, told of sets and ticks; the same on the bench and in a replay.

    Parameters
    ----------
    gyroscope, amplifier
        The drivers whose stamps are recorded.
    """

    def __init__(self, config: AmplifierConfig, gyroscope: Gyroscope, amplifier: Amplifier) -> None:
        self._config, self._gyroscope, self._amplifier = config, gyroscope, amplifier

    def _drive(self) -> ClockRetiming | None:
        return self._amplifier.retiming if takes_reported(self._config, self._amplifier) else None

    def _clocks(self) -> list[ClockRetiming]:
        drive = self._drive()
        return [self._gyroscope.retiming] if drive is None else [self._gyroscope.retiming, drive]

    def begin_set(self, start_s: float) -> None:
        """Stamps of a set follow."""
        for clock in self._clocks():
            clock.begin_set(start_s)

    def tick(self) -> None:
        """A tick is whole."""
        self._gyroscope.retiming.end_tick()
        drive = self._amplifier.retiming
        if drive is not None:
            drive.end_tick()

    def end_set(self) -> None:
        """The set is over."""
        for clock in self._clocks():
            clock.end_set()

    def expected_delay(self) -> ExpectedDelay:
        """Zero: what a driver knows of its road it takes off, and says so here."""
        torque = "torque timed when it was sent"
        if takes_reported(self._config, self._amplifier):
            when = "stamped by its own clock" if self._amplifier.stamps_torque else "timed when it arrived"
            torque = f"torque as the drive reports it, {when}"
        return ExpectedDelay(0.0, (*self._gyroscope.describe_delays(), torque))

    def corrections(self) -> tuple[Correction, ...]:
        """By set, in the order they were played; sets of which too little is known are left out.

        Both clocks are refined or neither: each alone would move one of two signals that belong together.
        """
        gyro = {one.start_s: one for one in self._gyroscope.retiming.retimed_sets(self._gyroscope.delay_s)}
        clock = self._drive()
        if clock is None:
            return tuple(Correction(start_s, _points(one), NO_POINTS) for start_s, one in gyro.items())
        drive = {one.start_s: one for one in clock.retimed_sets()}
        return tuple(
            Correction(start_s, _points(one), _points(drive[start_s]))
            for start_s, one in gyro.items()
            if start_s in drive
        )


def _points(one: RetimedSet) -> StampPoints:
    return tuple(one.recorded_s.tolist()), tuple(one.refined_s.tolist())
