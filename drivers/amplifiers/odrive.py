"""ODrive (firmware 0.5) over CANSimple: torque in N m, passthrough input.

The axis' watchdog is off as delivered and can only be switched on over USB (``axis0.config.enable_watchdog``,
``watchdog_timeout``); CANSimple cannot read it. So the driver proves it when it arms: with the axis in closed
loop at zero torque it falls silent for the watchdog time, and refuses an axis that goes on as if nothing were.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated

from pydantic import Field

from drivers.amplifiers.base import PROOF_FACTOR, Amplifier
from drivers.codecs import odrive_cansimple as wire
from drivers.codecs.lawicel import CanFrame
from drivers.codecs.odrive_cansimple import HEARTBEAT_S, WATCHDOG_EXPIRED, Command
from drivers.settings import Settings, read_settings
from drivers.transport.can_link import CanLink, ReceivedFrame
from rig.config.bench import AmplifierConfig
from rig.errors import ConfigError, DeviceFault


class OdriveSettings(Settings):
    """What the axis does not report."""

    peak_torque_nm: Annotated[float, Field(gt=0)] = 10.0
    """Torque of the motor that the axis' current limit allows, N m."""
    torque_constant_nm_a: Annotated[float, Field(gt=0)] = 1.0
    """Torque per current Iq, N m/A."""
    state_timeout_ms: Annotated[float, Field(ge=50, le=30_000)] = 1500.0
    """Longest wait for a change of state, ms."""


class Odrive(Amplifier):
    """One axis."""

    settings_model = OdriveSettings

    def __init__(self, config: AmplifierConfig) -> None:
        super().__init__(config)
        self.settings = read_settings(OdriveSettings, config.settings, "bench.amplifier.settings")
        if config.node > 63:
            raise ConfigError(f"bench.amplifier.node: {config.node} is not an ODrive node, allowed are 0 to 63")
        self.label = f"ODrive, node {config.node}"
        self._torque_id = self._id(Command.SET_INPUT_TORQUE)
        self._beat: wire.Heartbeat | None = None
        self._beat_at_s: float | None = None
        self._current_a: float | None = None
        self._armed = False

    def _id(self, command: Command) -> int:
        return wire.identifier(self.config.node, command)

    def _frame(self, command: Command, *values: float) -> CanFrame:
        return CanFrame(self._id(command), wire.encode(command, *values))

    @property
    def peak_torque_nm(self) -> float | None:
        """As declared, at the shaft."""
        return abs(self.shaft_nm(self.settings.peak_torque_nm))

    @property
    def actual_torque_nm(self) -> float | None:
        """From the measured current, at the shaft."""
        if self._current_a is None:
            return None
        return self.shaft_nm(self._current_a * self.settings.torque_constant_nm_a)

    @property
    def readings(self) -> Mapping[str, float]:
        """Iq."""
        return {} if self._current_a is None else {"drive_current_a": self._current_a}

    def contact(self, link: CanLink) -> list[str]:
        """Hear its heartbeat, clear its errors, set torque control; it stays idle."""
        if self.receive not in link.listeners:
            link.listeners.append(self.receive)
        if not link.wait(5 * HEARTBEAT_S, lambda: self._beat is not None):
            raise DeviceFault(f"{self.label} is silent: check its supply, node number, CAN bit rate and wiring")
        link.send([
            self._frame(Command.CLEAR_ERRORS),
            self._frame(Command.SET_CONTROLLER_MODE, wire.CONTROL_TORQUE, wire.INPUT_PASSTHROUGH),
        ])  # fmt: skip
        return [
            f"torque control, peak {self.peak_torque_nm:.4g} N m as declared",
            f"watchdog of {self.config.watchdog_ms} ms: CANSimple cannot read it, so it is tested when the "
            "drive is armed",
        ]

    def arm(self, link: CanLink) -> None:
        """Closed loop at zero torque; then prove that its watchdog cuts in, and close the loop again."""
        self._close_loop(link)
        self._prove_watchdog(link)
        link.send([self._frame(Command.CLEAR_ERRORS)])
        self._close_loop(link)
        self._armed = True

    def _close_loop(self, link: CanLink) -> None:
        zero = self._frame(Command.SET_INPUT_TORQUE, 0.0)
        link.send([
            zero,
            self._frame(Command.SET_CONTROLLER_MODE, wire.CONTROL_TORQUE, wire.INPUT_PASSTHROUGH),
            self._frame(Command.SET_AXIS_STATE, wire.AXIS_CLOSED_LOOP),
        ])  # fmt: skip
        self._beat = None
        timeout_s = self.settings.state_timeout_ms * 1e-3
        if not link.wait(timeout_s, self._is_closed, lambda: self._feed(link, zero)):
            raise DeviceFault(f"{self.label} does not enter closed-loop control: {self._describe_state()}")

    @staticmethod
    def _feed(link: CanLink, zero: CanFrame) -> None:
        link.send([zero])

    def _is_closed(self) -> bool:
        return self._beat is not None and self._beat.axis_state == wire.AXIS_CLOSED_LOOP

    def _prove_watchdog(self, link: CanLink) -> None:
        silent_s = PROOF_FACTOR * self.config.watchdog_ms * 1e-3 + 2 * HEARTBEAT_S
        self._beat = None
        tripped = link.wait(silent_s, lambda: self._beat is not None and bool(self._beat.axis_error & WATCHDOG_EXPIRED))
        if not tripped:
            link.send(self.off_frames())
            raise DeviceFault(
                f"{self.label} keeps running although this computer stopped sending. It is refused: switch its "
                "watchdog on (odrivetool: axis0.config.enable_watchdog = True, watchdog_timeout = "
                f"{self.config.watchdog_ms * 1e-3:g}, save_configuration())"
            )

    def frames(self, torque_nm: float, now_s: float) -> list[CanFrame]:
        """The torque, which feeds the watchdog, and a request for the current."""
        peak = self.settings.peak_torque_nm
        motor_nm = max(-peak, min(peak, self.motor_nm(torque_nm)))
        request = CanFrame(self._id(Command.GET_IQ), b"", remote=True, length=8)
        return [self._frame(Command.SET_INPUT_TORQUE, motor_nm), request]

    def sent_torque_nm(self, frame: CanFrame) -> float | None:
        """From a torque frame of ours."""
        if frame.identifier != self._torque_id:
            return None
        return self.shaft_nm(wire.decode(Command.SET_INPUT_TORQUE, frame.data)[0])

    def receive(self, heard: ReceivedFrame) -> None:
        """Heartbeat and current."""
        node, command = wire.split(heard.frame.identifier)
        if node != self.config.node or heard.frame.extended:
            return
        if command == Command.HEARTBEAT and len(heard.frame.data) >= 5:
            self._beat, self._beat_at_s = wire.decode_heartbeat(heard.frame.data), heard.time_s
        elif command == Command.GET_IQ and len(heard.frame.data) == 8:
            self._current_a = wire.decode(command, heard.frame.data)[1]

    def _describe_state(self) -> str:
        if self._beat is None:
            return "no heartbeat"
        state = wire.AXIS_STATES.get(self._beat.axis_state, f"state {self._beat.axis_state}")
        return f"{state}, {wire.errors_in_words(self._beat.axis_error) or 'no error reported'}"

    def check(self, now_s: float) -> None:
        """Error, state, silence."""
        if not self._armed or self._beat is None:
            return
        if self._beat.axis_error or self._beat.axis_state != wire.AXIS_CLOSED_LOOP:
            raise DeviceFault(
                f"{self.label} left closed loop: {self._describe_state()}. Remove the cause, clear the errors in "
                "odrivetool, then start again"
            )
        if self._beat_at_s is not None and now_s - self._beat_at_s > 3 * HEARTBEAT_S:
            raise DeviceFault(
                f"{self.label} is silent: no heartbeat for {(now_s - self._beat_at_s) * 1e3:.0f} ms "
                f"(limit {3 * HEARTBEAT_S * 1e3:.0f} ms): check its supply and the CAN cable"
            )

    def off_frames(self) -> Sequence[CanFrame]:
        """Zero torque, then idle."""
        return [
            self._frame(Command.SET_INPUT_TORQUE, 0.0),
            self._frame(Command.SET_AXIS_STATE, wire.AXIS_IDLE),
        ]

    def disarm(self, link: CanLink) -> None:
        """Idle, and seen to be idle."""
        self._armed = False
        link.send(self.off_frames(), urgent=True)
        asked_s = link.clock()
        off = link.wait(
            self.settings.state_timeout_ms * 1e-3,
            lambda: (self._beat_at_s or 0.0) > asked_s and not self._is_closed(),
        )
        if not off:
            raise DeviceFault(
                f"{self.label} does not confirm that it is idle ({self._describe_state()}): PRESS THE EMERGENCY STOP"
            )
