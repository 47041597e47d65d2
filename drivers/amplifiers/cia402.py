"""CiA 402 servo drives over CANopen: torque by PDO, watchdog by heartbeat, faults in words.

    every tick      RPDO {controlword, target torque}, SYNC; every quarter of the watchdog time a heartbeat
    from the drive  TPDO {statusword, actual torque} on SYNC, heartbeat, EMCY

The drive's heartbeat consumer (0x1016) watches ours and cuts the torque (0x6007) when it stops.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from drivers.amplifiers.base import Amplifier
from drivers.amplifiers.canopen_node import RemoteObjects, read_dictionary
from drivers.amplifiers.cia402_plan import DrivePlan, ModeWish, plan_drive, standard_dictionary
from drivers.can_link import CanLink, Heard
from drivers.codecs import cia402
from drivers.codecs.cia402 import State
from drivers.codecs.lawicel import CanFrame
from drivers.settings import Settings, read_settings
from drivers.source_clock import SourceClock
from rig.config.bench import AmplifierConfig
from rig.errors import ConfigError, DeviceFault
from rig.interface import TorqueSample

NMT_START, NMT_PRE_OPERATIONAL, NMT_RESET_COMMUNICATION = 0x01, 0x80, 0x82
NMT_OPERATIONAL = 0x05
SYNCHRONOUS, EVENT_DRIVEN = 1, 255
PER_MILLE = 1000
COMMAND_LIMIT = 32_767
BEATS_PER_WATCHDOG = 4
MISSED_BEATS = 3.0
STAMP_UNIT_S = 1e-6
OPTIONAL_OBJECTS = (
    cia402.MAX_TORQUE,
    cia402.RATED_TORQUE,
    cia402.ACTUAL_TORQUE,
    cia402.TORQUE_SLOPE,
    cia402.TIME_STAMP,
)


class Cia402Settings(Settings):
    """What differs between makers.

    ``eds`` is the maker's EDS or DCF, relative to where the command is run; without it the objects of the
    profile are assumed. A torque of 1000 in 0x6071 means ``reference_torque_nm`` at the motor; where that
    is left out, 0x6076 in units of ``rated_torque_unit_nm`` (0.001 by the profile; some maxon files only
    make sense in 1e-6). ``peak_torque_nm`` (motor) is needed where the drive has no 0x6072.
    ``sync: false`` makes the drive act on each frame at once. ``on_lost_host`` is written to 0x6007:
    1 fault, 2 disable voltage, 3 quick stop.
    """

    eds: str | None = None
    mode: ModeWish = "auto"
    reference_torque_nm: Annotated[float, Field(gt=0)] | None = None
    rated_torque_unit_nm: Annotated[float, Field(gt=0)] = 1e-3
    peak_torque_nm: Annotated[float, Field(gt=0)] | None = None
    sync: bool = True
    on_lost_host: Annotated[int, Field(ge=1, le=3)] = 1
    host_node: Annotated[int, Field(ge=1, le=127)] = 127
    drive_heartbeat_ms: Annotated[int, Field(ge=5, le=5000)] = 50
    sdo_timeout_ms: Annotated[float, Field(ge=10, le=10_000)] = 300.0
    state_timeout_ms: Annotated[float, Field(ge=50, le=30_000)] = 1500.0


class Cia402(Amplifier):
    """The driver. ``contact`` reads and sets up, ``arm`` walks the state machine, ``frames`` is the tick."""

    label = "CiA 402 drive"

    def __init__(self, config: AmplifierConfig) -> None:
        super().__init__(config)
        self.settings = read_settings(Cia402Settings, config.settings, "bench.amplifier.settings")
        if not 1 <= config.node <= 127:
            raise ConfigError(f"bench.amplifier.node: {config.node} is no CANopen node, allowed are 1 to 127")
        if config.node == self.settings.host_node:
            raise ConfigError(
                f"bench.amplifier.settings.host_node: {config.node} is the drive's own node number; choose another"
            )
        node = config.node
        self.label = f"CiA 402 drive, node {node}"
        self._rpdo_id, self._tpdo_id = 0x200 + node, 0x180 + node
        self._emergency_id, self._beat_id = 0x80 + node, 0x700 + node
        self._host_beat = CanFrame(0x700 + self.settings.host_node, bytes([NMT_OPERATIONAL]))
        self._sync = CanFrame(0x80, b"")
        self._beat_every_s = config.watchdog_ms * 1e-3 / BEATS_PER_WATCHDOG
        self._beat_due_s = 0.0
        self._reference_nm = 0.0
        self._peak_nm: float | None = None
        self.plan: DrivePlan | None = None
        self.statusword = 0
        self._status_at_s = -1.0
        self._actual: int | None = None
        self._last_beat_s: float | None = None
        self._nmt_state: int | None = None
        self.emergencies: list[tuple[float, str]] = []
        self._new_emergency = ""
        self._armed = False
        self._objects: RemoteObjects | None = None
        self._stamped = False
        self._drive_clock = SourceClock(STAMP_UNIT_S)
        self._stamp: int | None = None
        self._last_torque_s = 0.0

    # -- set-up ----------------------------------------------------------------------------------

    def contact(self, link: CanLink) -> list[str]:
        """Read the drive, map its PDOs, arm its watchdog; it stays disabled."""
        s, node = self.settings, self.config.node
        dictionary = read_dictionary(Path(s.eds), node) if s.eds else standard_dictionary(node)
        # What the file says is checked first: a drive that cannot do it is refused before a frame is sent.
        plan_drive(dictionary, s.mode, None, s.peak_torque_nm is not None, s.reference_torque_nm is not None)
        objects = self._objects = RemoteObjects(link, node, dictionary, s.sdo_timeout_ms * 1e-3, self.label)
        if self.receive not in link.listeners:
            link.listeners.append(self.receive)
        link.send([CanFrame(0, bytes([NMT_PRE_OPERATIONAL, node]))])
        device = objects.read(0x1000)
        modes = objects.read_if_there(cia402.SUPPORTED_MODES)
        plan = plan_drive(
            self._present(dictionary, objects),
            s.mode,
            modes,
            s.peak_torque_nm is not None,
            s.reference_torque_nm is not None,
        )
        self.plan = plan
        self._read_scale(objects, plan)
        self._watch(objects)
        self._map(objects, plan)
        objects.write(cia402.MODE, 0, plan.mode, 1)
        link.send([CanFrame(0, bytes([NMT_START, node]))])
        notes = [] if device & 0xFFFF == 402 else [f"0x1000 says profile {device & 0xFFFF}, not 402"]
        step = abs(self.shaft_nm(self._reference_nm)) / PER_MILLE
        return [
            f"{plan.mode_name}, steps of {step:.4g} N m, peak {self.peak_torque_nm:.4g} N m",
            f"watchdog of {self.config.watchdog_ms} ms set in the drive and read back",
            *plan.fallbacks,
            *notes,
        ]

    def _present(self, dictionary: Any, objects: RemoteObjects) -> Any:
        """Without an EDS, leave out what this drive turns out not to have."""
        if self.settings.eds is None:
            for index in OPTIONAL_OBJECTS:
                if objects.read_if_there(index) is None:
                    del dictionary[index]
        return dictionary

    def _read_scale(self, objects: RemoteObjects, plan: DrivePlan) -> None:
        s = self.settings
        if s.reference_torque_nm is not None:
            self._reference_nm = s.reference_torque_nm
        else:
            self._reference_nm = objects.read(cia402.RATED_TORQUE) * s.rated_torque_unit_nm
        if self._reference_nm <= 0.0:
            raise DeviceFault(
                f"{self.label}: 0x6076 (rated torque) is 0, so a command has no scale: commission the drive, or "
                "set bench.amplifier.settings.reference_torque_nm"
            )
        peak = s.peak_torque_nm
        if plan.has_max_torque:
            own = objects.read(cia402.MAX_TORQUE) * self._reference_nm / PER_MILLE
            peak = own if peak is None else min(peak, own)
        assert peak is not None  # the plan refuses a drive that leaves it open
        self._peak_nm = min(peak, COMMAND_LIMIT * self._reference_nm / PER_MILLE)

    def _watch(self, objects: RemoteObjects) -> None:
        """Set the drive to watch our heartbeat, and read back that it does; refuse if it cannot."""
        s = self.settings
        wanted = s.host_node << 16 | self.config.watchdog_ms
        objects.write(cia402.HEARTBEAT_PRODUCER, 0, s.drive_heartbeat_ms, 2)
        objects.write(cia402.HEARTBEAT_CONSUMER, 1, wanted, 4)
        if objects.read(cia402.HEARTBEAT_CONSUMER, 1) != wanted:
            raise DeviceFault(
                f"{self.label} did not keep its heartbeat consumer (0x1016:01): it would go on driving when this "
                "computer dies. Refused; use a drive or firmware that has one."
            )
        if objects.read_if_there(cia402.ABORT_CONNECTION_OPTION) is not None:
            objects.write(cia402.ABORT_CONNECTION_OPTION, 0, s.on_lost_host, 2)
            if objects.read(cia402.ABORT_CONNECTION_OPTION, signed=True) == 0:
                raise DeviceFault(f"{self.label}: 0x6007 stays 0, so a lost computer would change nothing: refused")

    def _map(self, objects: RemoteObjects, plan: DrivePlan) -> None:
        kind = SYNCHRONOUS if self.settings.sync else EVENT_DRIVEN
        rpdo = objects.remote.rpdo[1]
        self._remap(rpdo, self._rpdo_id, kind, (cia402.CONTROLWORD, cia402.TARGET_TORQUE))
        objects.save_pdo(rpdo, "RPDO 1 (controlword, target torque)")
        reported = (cia402.STATUSWORD,) + ((cia402.ACTUAL_TORQUE,) if plan.has_actual_torque else ())
        self._stamped = plan.has_time_stamp and plan.has_actual_torque and self.settings.sync
        if self._stamped:
            self._stamped = self._map_status(objects, kind, (*reported, cia402.TIME_STAMP), may_refuse=True)
        if not self._stamped:
            self._map_status(objects, kind, reported)
        if not self.settings.sync and objects.read_if_there(0x1800, 5) is not None:
            objects.write(0x1800, 5, 10, 2)

    def _map_status(self, objects: RemoteObjects, kind: int, indices: Sequence[int], may_refuse: bool = False) -> bool:
        """Map what the drive reports; False where it refuses and may (0x1013 need not be mappable)."""
        tpdo = objects.remote.tpdo[1]
        self._remap(tpdo, self._tpdo_id, kind, indices)
        try:
            objects.save_pdo(tpdo, "TPDO 1 (statusword, actual torque)")
        except DeviceFault:
            if not may_refuse:
                raise
            return False
        return True

    @staticmethod
    def _remap(pdo: Any, cob_id: int, kind: int, indices: Sequence[int]) -> None:
        pdo.clear()
        for index in indices:
            pdo.add_variable(index)
        pdo.cob_id, pdo.trans_type, pdo.enabled, pdo.rtr_allowed = cob_id, kind, True, True
        pdo.event_timer = pdo.inhibit_time = pdo.sync_start_value = None

    def settle(self, link: CanLink) -> None:
        """SYNC alone makes the drive report its time, so that its clock is known before anything moves."""
        if self._stamped:
            link.send([self._sync])

    # -- state machine ---------------------------------------------------------------------------

    @property
    def state(self) -> State | None:
        """State of the drive by its last statusword."""
        return cia402.state_of(self.statusword)

    def arm(self, link: CanLink) -> None:
        """Operational, fault reset if need be, then to "operation enabled" at zero torque."""
        assert self._objects is not None, "contact the drive first"
        s = self.settings
        self._new_emergency = ""
        self._watch(self._objects)
        link.send([CanFrame(0, bytes([NMT_START, self.config.node])), self._host_beat])
        if self._objects.read(cia402.STATUSWORD) and self._refresh(link) is State.FAULT:
            self._reset_fault(link)
        self._walk(link, s.state_timeout_ms * 1e-3)
        shown = self._objects.read(cia402.MODE_DISPLAY, signed=True)
        assert self.plan is not None
        if shown & 0xFF != self.plan.mode:
            raise DeviceFault(f"{self.label} is in mode {shown} (0x6061) instead of {self.plan.mode_name}")
        self._last_beat_s = link.clock()
        self._nmt_state = None  # the last heartbeat may have been sent before the drive was started
        self._armed = True

    def _refresh(self, link: CanLink) -> State | None:
        assert self._objects is not None
        self.statusword = self._objects.read(cia402.STATUSWORD)
        self._status_at_s = link.clock()
        return self.state

    def _reset_fault(self, link: CanLink) -> None:
        link.send(self._command(cia402.DISABLE_VOLTAGE, 0))
        link.send(self._command(cia402.FAULT_RESET, 0))
        done = link.wait(
            self.settings.state_timeout_ms * 1e-3,
            lambda: self._refresh(link) is not State.FAULT,
            self._keep_alive(link),
        )
        if not done:
            raise DeviceFault(
                f"{self.label} stays in fault: {self._why()}. Remove the cause, then switch the drive off and on."
            )
        self._new_emergency = ""

    def _walk(self, link: CanLink, timeout_s: float) -> None:
        """One controlword a step, each awaited."""
        deadline = link.clock() + timeout_s
        keep_alive = self._keep_alive(link)
        while (state := self._refresh(link)) is not State.ENABLED:
            step = cia402.PATH_TO_ENABLED.get(state) if state else None
            if state in (State.FAULT, State.FAULT_REACTION):
                raise DeviceFault(f"{self.label} went to fault while it was enabled: {self._why()}")
            if step is not None:
                link.send(self._command(step, 0))
                link.wait(0.01, lambda before=state: self.state is not before, keep_alive)  # type: ignore[misc]
            if link.clock() > deadline:
                raise DeviceFault(
                    f"{self.label} stays in '{state.value if state else 'unknown state'}' after {timeout_s:g} s "
                    f"(statusword 0x{self.statusword:04X}): check its DC supply, enable input and STO"
                )

    def _keep_alive(self, link: CanLink) -> Callable[[], None]:
        def beat() -> None:
            if link.clock() >= self._beat_due_s:
                self._beat_due_s = link.clock() + self._beat_every_s
                link.send([self._host_beat])

        return beat

    def disarm(self, link: CanLink) -> None:
        """Zero torque, shut down, and read the statusword back."""
        self._armed = False
        if self._objects is None:
            return
        link.send(self._command(cia402.ENABLE_OPERATION, 0), urgent=True)
        link.send(self._command(cia402.SHUTDOWN, 0))
        link.send(self._command(cia402.DISABLE_VOLTAGE, 0))
        off = link.wait(
            self.settings.state_timeout_ms * 1e-3,
            lambda: self._refresh(link) not in (State.ENABLED, State.QUICK_STOP),
        )
        if not off:
            raise DeviceFault(
                f"{self.label} still says 'operation enabled' (statusword 0x{self.statusword:04X}) after it was "
                "told to disable: PRESS THE EMERGENCY STOP and check the drive"
            )
        link.send([CanFrame(0, bytes([NMT_PRE_OPERATIONAL, self.config.node]))])
        # It is off and was seen to be: stop watching, or it would report a fault when we fall silent.
        self._objects.write(cia402.HEARTBEAT_CONSUMER, 1, 0, 4)

    # -- the tick --------------------------------------------------------------------------------

    def _command(self, controlword: int, torque_per_mille: int) -> list[CanFrame]:
        frames = [CanFrame(self._rpdo_id, struct.pack("<Hh", controlword, torque_per_mille))]
        return [*frames, self._sync] if self.settings.sync else frames

    def frames(self, torque_nm: float, now_s: float) -> list[CanFrame]:
        """Set point, SYNC, and the heartbeat when it is due."""
        peak = self._peak_nm or 0.0
        motor_nm = max(-peak, min(peak, self.motor_nm(torque_nm)))
        frames = self._command(cia402.ENABLE_OPERATION, round(motor_nm / self._reference_nm * PER_MILLE))
        if now_s >= self._beat_due_s:
            self._beat_due_s = now_s + self._beat_every_s
            frames.append(self._host_beat)
        return frames

    def sent_torque_nm(self, frame: CanFrame) -> float | None:
        """From an RPDO of ours."""
        if frame.identifier != self._rpdo_id or len(frame.data) != 4:
            return None
        controlword, per_mille = struct.unpack("<Hh", frame.data)
        enabled = controlword == cia402.ENABLE_OPERATION
        return self.shaft_nm(per_mille * self._reference_nm / PER_MILLE) if enabled else 0.0

    def off_frames(self) -> Sequence[CanFrame]:
        """Zero torque, then out of operation."""
        return [*self._command(cia402.ENABLE_OPERATION, 0), *self._command(cia402.SHUTDOWN, 0)]

    # -- from the drive --------------------------------------------------------------------------

    @property
    def peak_torque_nm(self) -> float | None:
        """At the shaft."""
        return None if self._peak_nm is None else abs(self.shaft_nm(self._peak_nm))

    @property
    def actual_torque_nm(self) -> float | None:
        """0x6077, at the shaft."""
        if self._actual is None:
            return None
        return self.shaft_nm(self._actual * self._reference_nm / PER_MILLE)

    def receive(self, heard: Heard) -> None:
        """Status, actual torque, heartbeat, emergencies."""
        can_id, data = heard.frame.identifier, heard.frame.data
        if can_id == self._tpdo_id and len(data) >= 2:
            self.statusword = int.from_bytes(data[:2], "little")
            self._status_at_s = heard.time_s
            if len(data) >= 4:
                self._actual = int.from_bytes(data[2:4], "little", signed=True)
                self._note_torque(heard.time_s, data)
        elif can_id == self._beat_id and data:
            self._last_beat_s, self._nmt_state = heard.time_s, data[0] & 0x7F
        elif can_id == self._emergency_id and len(data) >= 3:
            code, register, _ = cia402.decode_emergency(data)
            text = f"EMCY 0x{code:04X} {cia402.emergency_in_words(code)} (register 0x{register:02X})"
            self.emergencies.append((heard.time_s, text))
            self._new_emergency = text if code else ""

    @property
    def stamps_torque(self) -> bool:
        """True where 0x1013 is mapped beside the actual torque."""
        return self._stamped

    def _note_torque(self, heard_s: float, data: bytes) -> None:
        """The reported torque with its time: the drive's own, put on the host's clock, where it gives one."""
        time_s = heard_s
        if self._stamped and len(data) >= 8:
            stamp = int.from_bytes(data[4:8], "little")
            before = self._stamp if self._stamp is not None else stamp
            self._stamp = before + ((stamp - before) & 0xFFFFFFFF)
            self._drive_clock.observe(self._stamp, heard_s)
            time_s = self._drive_clock.host_time_s(self._stamp)
        # Set points that the drive took up together carry one stamp; the last of them is the one that holds.
        time_s = max(time_s, self._last_torque_s + STAMP_UNIT_S)
        self._last_torque_s = time_s
        actual = self.actual_torque_nm
        if actual is not None:
            self._reported.append(TorqueSample(time_s, actual))

    def _why(self) -> str:
        if self._new_emergency:
            return self._new_emergency
        code = self._objects.read_if_there(cia402.ERROR_CODE) if self._objects else None
        return f"error code 0x{code:04X} {cia402.emergency_in_words(code)}" if code else "no error code given"

    def check(self, now_s: float) -> None:
        """Emergency, state, NMT state, silence."""
        if not self._armed:
            return
        if self._new_emergency:
            raise DeviceFault(f"{self.label}: {self._new_emergency}")
        if self.state is not State.ENABLED:
            name = self.state.value if self.state else f"statusword 0x{self.statusword:04X}"
            raise DeviceFault(f"{self.label} left 'operation enabled' by itself and is in '{name}'")
        if self._nmt_state is not None and self._nmt_state != NMT_OPERATIONAL:
            raise DeviceFault(
                f"{self.label} left NMT state operational (now {self._nmt_state}): it was reset or lost its supply"
            )
        limit_s = MISSED_BEATS * self.settings.drive_heartbeat_ms * 1e-3
        if self._last_beat_s is not None and now_s - self._last_beat_s > limit_s:
            raise DeviceFault(
                f"{self.label} is silent: no heartbeat for {(now_s - self._last_beat_s) * 1e3:.0f} ms "
                f"(limit {limit_s * 1e3:.0f} ms): check its supply and the CAN cable"
            )
