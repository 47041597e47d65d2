"""An emulated ODrive axis that speaks CANSimple."""

from __future__ import annotations

from drivers.codecs import odrive_cansimple as wire
from drivers.codecs.lawicel import CanFrame
from drivers.codecs.odrive_cansimple import HEARTBEAT_S, WATCHDOG_EXPIRED, Command
from sim_backend.emulators.device import Event, TorqueOutput

ESTOP_REQUESTED = 0x4000
INVALID_STATE = 0x1


class OdriveAxis:
    """Torque control with input passthrough; every frame addressed to the axis feeds its watchdog.

    Parameters
    ----------
    node
        Axis node number, 0 to 63.
    peak_torque_nm
        Commands are limited to it.
    torque_constant_nm_a
        For the reported current.
    watchdog_s
        0 switches it off, which is how the device is delivered.
    """

    def __init__(
        self,
        node: int,
        peak_torque_nm: float,
        torque_constant_nm_a: float = 1.0,
        watchdog_s: float = 0.1,
    ) -> None:
        self._node = node
        self._peak_nm = peak_torque_nm
        self._constant = torque_constant_nm_a
        self._watchdog_s = watchdog_s
        self._fed_s: float | None = None
        self._output = TorqueOutput()
        self._axis_state = wire.AXIS_IDLE
        self._error = 0
        self._mode = (0, 0)
        self._beat_due_s = 0.0
        self._out: list[CanFrame] = []

    @property
    def torque_nm(self) -> float:
        """Torque on the shaft."""
        return self._output.torque_nm

    def receive(self, frame: CanFrame, now_s: float) -> None:
        """Dispatch one frame."""
        node, number = wire.split(frame.identifier)
        if node != self._node or number not in Command.__members__.values():
            return
        self._fed_s = now_s
        command = Command(number)
        if frame.remote:
            self._report(command)
            return
        self._obey(command, frame.data, now_s)

    def _obey(self, command: Command, data: bytes, now_s: float) -> None:
        if command is Command.ESTOP:
            self._fail(ESTOP_REQUESTED, now_s, "emergency stop")
        elif command is Command.CLEAR_ERRORS:
            self._error = 0
        elif command is Command.SET_CONTROLLER_MODE:
            control, inputs = wire.decode(command, data)
            self._mode = int(control), int(inputs)
        elif command is Command.SET_AXIS_STATE:
            self._change_state(int(wire.decode(command, data)[0]), now_s)
        elif command is Command.SET_INPUT_TORQUE and self._follows():
            torque = wire.decode(command, data)[0]
            self._output.apply(max(-self._peak_nm, min(self._peak_nm, torque)), now_s)

    def _follows(self) -> bool:
        wanted = (wire.CONTROL_TORQUE, wire.INPUT_PASSTHROUGH)
        return self._axis_state == wire.AXIS_CLOSED_LOOP and self._mode == wanted

    def _change_state(self, state: int, now_s: float) -> None:
        if state == wire.AXIS_CLOSED_LOOP and self._error:
            self._error |= INVALID_STATE
            return
        was = self._axis_state
        self._axis_state = state
        if state == wire.AXIS_CLOSED_LOOP != was:
            self._output.apply(0.0, now_s, "enabled")
        elif was == wire.AXIS_CLOSED_LOOP != state:
            self._output.apply(0.0, now_s, "disabled")

    def fail(self, code: int, now_s: float) -> None:
        """Go to fault by itself, with a code of the maker's."""
        self._fail(code, now_s, f"error 0x{code:X}")

    def restart(self, now_s: float) -> None:
        """As after a dip of the supply."""
        self._change_state(wire.AXIS_IDLE, now_s)
        self._error, self._mode = 0, (0, 0)

    def _fail(self, error: int, now_s: float, detail: str) -> None:
        self._error |= error
        self._axis_state = wire.AXIS_IDLE
        self._output.apply(0.0, now_s, "fault", detail)

    def _report(self, command: Command) -> None:
        values: dict[Command, tuple[float, ...]] = {
            Command.GET_IQ: (self.torque_nm / self._constant,) * 2,
            Command.GET_BUS_VOLTAGE_CURRENT: (48.0, 0.0),
            Command.GET_ENCODER_ESTIMATES: (0.0, 0.0),
        }
        if command in values:
            self._send(command, *values[command])

    def _send(self, command: Command, *values: float) -> None:
        self._out.append(CanFrame(wire.identifier(self._node, command), wire.encode(command, *values)))

    def acts_at(self, now_s: float) -> float:
        """At once: it stamps nothing that this could be held against."""
        return now_s

    def tick(self, now_s: float) -> None:
        """Watchdog and heartbeat."""
        running = self._axis_state == wire.AXIS_CLOSED_LOOP
        if running and self._watchdog_s and self._fed_s is not None and now_s - self._fed_s > self._watchdog_s:
            self._output.apply(0.0, now_s, "watchdog", "no frame from the host")
            self._fail(WATCHDOG_EXPIRED, now_s, "watchdog timer expired")
        if now_s >= self._beat_due_s:
            self._beat_due_s = now_s + HEARTBEAT_S
            self._send(Command.HEARTBEAT, self._error, self._axis_state, 0, 0, 0)

    def take_frames(self) -> list[CanFrame]:
        """Frames to send since the last call."""
        frames, self._out = self._out, []
        return frames

    def take_events(self, now_s: float) -> list[Event]:
        """Events since the last call."""
        return self._output.take_events(now_s)
