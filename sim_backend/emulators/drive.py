"""An emulated CiA 402 torque drive: state machine, torque modes, limits, quick stop, faults."""

from __future__ import annotations

import math
from pathlib import Path

from drivers.codecs import cia402
from drivers.codecs.cia402 import State
from sim_backend.emulators.canopen_node import STATE_OPERATIONAL, CanopenNode
from sim_backend.emulators.device import Event, TorqueOutput
from sim_backend.emulators.object_dictionary import ABORT_COMMAND, SdoAbort

EDS = Path(__file__).with_name("cia402_drive.eds")
HEARTBEAT_LOST = 0x8130
ABORT_OPTION_FAULT_SIGNAL, ABORT_OPTION_DISABLE_VOLTAGE, ABORT_OPTION_QUICK_STOP = 1, 2, 3  # codes of 0x6007
_COMMUNICATION_ERROR = 0x11
_REMOTE_BIT = 1 << 9
_TORQUE_OBJECTS = (cia402.CONTROLWORD, cia402.TARGET_TORQUE, cia402.MODE)


class Cia402Drive(CanopenNode):
    """A drive whose torque follows 0x6071 in its torque modes while it is enabled and operational.

    Parameters
    ----------
    node
        Its node number.
    rated_torque_nm, peak_torque_nm
        What 0x6076 (in mN m) and 0x6072 (in thousandths of the former) say.
    drift_ppm
        How much faster its clock (0x1013) runs than the host's.
    """

    def __init__(self, node: int, rated_torque_nm: float, peak_torque_nm: float, drift_ppm: float = 0.0) -> None:
        super().__init__(EDS, node)
        self._us_per_s = 1e6 * (1.0 + drift_ppm * 1e-6)
        self._output = TorqueOutput()
        self._drive_state = State.SWITCH_ON_DISABLED
        self._last_controlword = 0
        self._now_s = 0.0
        self.od.set(cia402.RATED_TORQUE, round(rated_torque_nm * 1e3))
        self.od.set(cia402.MAX_TORQUE, round(1e3 * peak_torque_nm / rated_torque_nm))
        for index in _TORQUE_OBJECTS:
            self.od.before_write[index] = self._check_write(index)
        self._enter(State.SWITCH_ON_DISABLED)

    @property
    def torque_nm(self) -> float:
        """Torque on the shaft."""
        return self._output.torque_nm

    def take_events(self, now_s: float) -> list[Event]:
        """Events since the last call."""
        return self._output.take_events(now_s)

    def _check_write(self, index: int):  # type: ignore[no-untyped-def]
        def check(_: int, data: bytes) -> None:
            value = int.from_bytes(data, "little", signed=index != cia402.CONTROLWORD)
            if index == cia402.MODE and value not in (0, *cia402.MODE_BITS):
                raise SdoAbort(ABORT_COMMAND)

        return check

    def receive(self, frame, now_s: float) -> None:  # type: ignore[no-untyped-def]
        """A frame from the host; SDO writes act at once, PDOs when they are taken."""
        self._now_s = now_s
        super().receive(frame, now_s)
        if frame.identifier == 0x600 + self.node:
            self.on_pdo(now_s)

    def acts_at(self, now_s: float) -> float:
        """The tick of its own clock that it stamps: a drive changes its current by its clock, never in between."""
        return math.floor(now_s * self._us_per_s) / self._us_per_s

    def on_sync(self, now_s: float) -> None:
        """Stamp the torque that was just put on the shaft with the drive's own time."""
        self.od.set(cia402.TIME_STAMP, math.floor(now_s * self._us_per_s) & 0xFFFFFFFF)

    # -- state machine ---------------------------------------------------------------------------

    def on_pdo(self, now_s: float) -> None:
        """Follow controlword, mode and target torque."""
        self.od.set(cia402.MODE_DISPLAY, self.od.get(cia402.MODE))
        controlword = self.od.get(cia402.CONTROLWORD)
        rising = controlword & ~self._last_controlword
        self._last_controlword = controlword
        self._follow(controlword, rising, now_s)
        self._update_torque(now_s)

    def _follow(self, controlword: int, rising: int, now_s: float) -> None:
        state = self._drive_state
        if state is State.FAULT:
            if rising & cia402.FAULT_RESET:
                self.emergency(0, 0)
                self._enter(State.SWITCH_ON_DISABLED)
            return
        voltage, quick_stop = controlword & 0b10, not controlword & 0b100
        if not voltage:
            self._leave_to(State.SWITCH_ON_DISABLED, now_s)
        elif quick_stop:
            self._leave_to(State.SWITCH_ON_DISABLED, now_s, "quick stop")
        elif controlword & 0b1111 == cia402.ENABLE_OPERATION:
            if state is State.SWITCHED_ON:
                self._enter(State.ENABLED)
                self._output.apply(0.0, now_s, "enabled")
        elif controlword & 0b111 == cia402.SWITCH_ON:
            if state is State.READY:
                self._enter(State.SWITCHED_ON)
            elif state is State.ENABLED:
                self._leave_to(State.SWITCHED_ON, now_s)
        elif state is State.SWITCH_ON_DISABLED or state is State.SWITCHED_ON:
            self._enter(State.READY)
        elif state is State.ENABLED:
            self._leave_to(State.READY, now_s)

    def _leave_to(self, state: State, now_s: float, detail: str = "") -> None:
        was_enabled = self._drive_state is State.ENABLED
        self._enter(state)
        if was_enabled:
            self._output.apply(0.0, now_s, "disabled", detail)

    def _enter(self, state: State) -> None:
        self._drive_state = state
        self.od.set(cia402.STATUSWORD, cia402.statusword_of(state) | _REMOTE_BIT)

    # -- torque ----------------------------------------------------------------------------------

    def _update_torque(self, now_s: float) -> None:
        limit = self.od.get(cia402.MAX_TORQUE)
        wanted = max(-limit, min(limit, self.od.get(cia402.TARGET_TORQUE)))
        follows = (
            self._drive_state is State.ENABLED
            and self.state == STATE_OPERATIONAL
            and self.od.get(cia402.MODE_DISPLAY) in cia402.MODE_BITS
        )
        per_mille = wanted if follows else 0
        self.od.set(cia402.ACTUAL_TORQUE, per_mille)
        self._output.apply(per_mille * self.od.get(cia402.RATED_TORQUE) * 1e-6, now_s)

    def on_leaving_operational(self, now_s: float) -> None:
        """No PDOs, no torque."""
        self._leave_to(State.SWITCH_ON_DISABLED, now_s, "NMT state left operational")
        self._update_torque(now_s)

    def on_reset(self, now_s: float) -> None:
        """As after power-on."""
        self._leave_to(State.SWITCH_ON_DISABLED, now_s, "NMT reset")
        for index in (cia402.CONTROLWORD, cia402.TARGET_TORQUE, cia402.MODE, cia402.MODE_DISPLAY):
            self.od.set(index, 0)
        self.od.set(cia402.HEARTBEAT_CONSUMER, 0, 1)
        self.od.set(cia402.HEARTBEAT_PRODUCER, 0)
        self._last_controlword = 0
        self._update_torque(now_s)

    def on_heartbeat_lost(self, now_s: float) -> None:
        """React as 0x6007 says; with 0 the drive goes on."""
        reaction = self.od.get(cia402.ABORT_CONNECTION_OPTION)
        self.emergency(HEARTBEAT_LOST, _COMMUNICATION_ERROR)
        if not reaction:
            return
        enabled = self._drive_state is State.ENABLED
        self._output.apply(0.0, now_s, "watchdog", "heartbeat of the host lost")
        if reaction == ABORT_OPTION_FAULT_SIGNAL:
            self.fail(HEARTBEAT_LOST, now_s, announce=False)
        elif enabled:
            self._leave_to(State.SWITCH_ON_DISABLED, now_s, "watchdog")
        self._update_torque(now_s)

    def fail(self, code: int, now_s: float, announce: bool = True) -> None:
        """Go to fault with this error code."""
        if announce:
            self.emergency(code, 0x01)
        self.od.set(cia402.ERROR_CODE, code)
        self._enter(State.FAULT)
        self._output.apply(0.0, now_s, "fault", f"0x{code:04X} {cia402.emergency_in_words(code)}")
        self.od.set(cia402.TARGET_TORQUE, 0)
