"""CiA 402 servo drives over CANopen: torque by PDO, watchdog fed by heartbeat, faults in words.

    every tick      RPDO {controlword, target torque}, SYNC; every quarter of the watchdog time a heartbeat
    from the drive  TPDO {statusword, actual torque, time} on SYNC, heartbeat, EMCY

The drive's heartbeat consumer (0x1016) watches ours and cuts the torque (0x6007) when it stops.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

from drivers.amplifiers.base import Amplifier
from drivers.amplifiers.cia402_plan import DrivePlan
from drivers.amplifiers.cia402_setup import (
    NMT_PRE_OPERATIONAL,
    NMT_START,
    PER_MILLE,
    AgreedSetup,
    Cia402Settings,
    Cia402Setup,
)
from drivers.amplifiers.cia402_status import NMT_OPERATIONAL, DriveStatus
from drivers.amplifiers.torque_clock import TorqueClock
from drivers.bounded_log import FirstAndLast
from drivers.codecs import cia402
from drivers.codecs.cia402 import State
from drivers.codecs.lawicel import CanFrame
from drivers.settings import read_settings
from drivers.timing.retiming import ClockRetiming
from drivers.transport.can_link import CanLink, ReceivedFrame
from rig.config.bench import AmplifierConfig
from rig.errors import ConfigError, DeviceFault
from rig.interface import TorqueSample

BEATS_PER_WATCHDOG = 4  # heartbeats within the watchdog: three may be lost
STAMP_UNIT_S, STAMP_MODULUS = 1e-6, 1 << 32  # of 0x1013


class Cia402(Amplifier):
    """The driver. ``contact`` reads and sets up, ``arm`` walks the state machine, ``frames`` is the tick."""

    label = "CiA 402 drive"

    settings_model = Cia402Settings

    def __init__(self, config: AmplifierConfig) -> None:
        super().__init__(config)
        self.settings = read_settings(Cia402Settings, config.settings, "bench.amplifier.settings")
        if not 1 <= config.node <= 127:
            raise ConfigError(f"bench.amplifier.node: {config.node} is not a CANopen node, allowed are 1 to 127")
        if config.node == self.settings.host_node:
            raise ConfigError(
                f"bench.amplifier.settings.host_node: {config.node} is the drive's own node number; choose another"
            )
        node = config.node
        self.label = f"CiA 402 drive, node {node}"
        self._setup = Cia402Setup(self.settings, node, config.watchdog_ms, self.label)
        self._setup.dictionary()  # a file that is not there, or says that the drive cannot do it, is refused at once
        self._status = DriveStatus(node, self.settings.drive_heartbeat_ms * 1e-3, self.label)
        self._clock = TorqueClock(STAMP_UNIT_S, STAMP_MODULUS)
        self._agreed: AgreedSetup | None = None
        self._rpdo_id = 0x200 + node
        self._host_beat = CanFrame(0x700 + self.settings.host_node, bytes([NMT_OPERATIONAL]))
        self._sync = CanFrame(0x80, b"")
        self._beat_every_s = config.watchdog_ms * 1e-3 / BEATS_PER_WATCHDOG
        self._beat_due_s = 0.0
        self._actual: int | None = None
        self._armed = False

    # -- set-up ----------------------------------------------------------------------------------

    def contact(self, link: CanLink) -> list[str]:
        """Read the drive, map its PDOs, arm its watchdog; it stays disabled."""
        if self.receive not in link.listeners:
            link.listeners.append(self.receive)
        agreed = self._agreed = self._setup.run(link)
        step = abs(self.shaft_nm(agreed.reference_nm)) / PER_MILLE
        return [
            f"{agreed.plan.mode_name}, steps of {step:.4g} N m, peak {self.peak_torque_nm:.4g} N m",
            f"watchdog of {self.config.watchdog_ms} ms set in the drive and read back",
            *agreed.notes,
        ]

    @property
    def plan(self) -> DrivePlan | None:
        """How the drive is commanded, once contacted."""
        return None if self._agreed is None else self._agreed.plan

    @property
    def emergencies(self) -> FirstAndLast[tuple[float, str]]:
        """Emergency messages so far, the first and the last, each with the time at which it was heard."""
        return self._status.emergencies

    @property
    def statusword(self) -> int:
        """The last one heard."""
        return self._status.statusword

    def settle(self, link: CanLink) -> None:
        """SYNC alone makes the drive report its time, so that its clock is known before anything moves."""
        if self.stamps_torque:
            link.send([self._sync])

    # -- state machine ---------------------------------------------------------------------------

    @property
    def state(self) -> State | None:
        """State of the drive by its last statusword."""
        return self._status.state

    def arm(self, link: CanLink) -> None:
        """Operational, fault reset if need be, then to "operation enabled" at zero torque."""
        agreed, status = self._contacted(), self._status
        status.new_emergency = ""
        self._setup.watch(agreed.objects)
        link.send([CanFrame(0, bytes([NMT_START, self.config.node])), self._host_beat])
        if self._refresh() is State.FAULT:
            self._reset_fault(link)
        self._walk(link, self.settings.state_timeout_ms * 1e-3)
        shown = agreed.objects.read(cia402.MODE_DISPLAY, signed=True)
        if shown & 0xFF != agreed.plan.mode:
            raise DeviceFault(
                f"{self.label} is in mode {shown} (0x6061) instead of {agreed.plan.mode_name}: end what else commands "
                "it (its own program, another master)"
            )
        status.begin(link.clock())
        self._armed = True

    def _contacted(self) -> AgreedSetup:
        if self._agreed is None:
            raise DeviceFault(f"{self.label} was not contacted before: open the bench first")
        return self._agreed

    def _refresh(self) -> State | None:
        self._status.statusword = self._contacted().objects.read(cia402.STATUSWORD)
        return self.state

    def _reset_fault(self, link: CanLink) -> None:
        link.send(self._command(cia402.DISABLE_VOLTAGE, 0))
        link.send(self._command(cia402.FAULT_RESET, 0))
        done = link.wait(
            self.settings.state_timeout_ms * 1e-3,
            lambda: self._refresh() is not State.FAULT,
            self._keep_alive(link),
        )
        if not done:
            raise DeviceFault(
                f"{self.label} stays in fault: {self._why()}. Remove the cause, then switch the drive off and on."
            )
        self._status.new_emergency = ""

    def _walk(self, link: CanLink, timeout_s: float) -> None:
        """One controlword a step, each awaited."""
        deadline = link.clock() + timeout_s
        keep_alive = self._keep_alive(link)
        while (state := self._refresh()) is not State.ENABLED:
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
        if self._agreed is None:
            return
        link.send(self._command(cia402.ENABLE_OPERATION, 0), urgent=True)
        link.send(self._command(cia402.SHUTDOWN, 0))
        link.send(self._command(cia402.DISABLE_VOLTAGE, 0))
        off = link.wait(
            self.settings.state_timeout_ms * 1e-3,
            lambda: self._refresh() not in (State.ENABLED, State.QUICK_STOP),
        )
        if not off:
            raise DeviceFault(
                f"{self.label} still reports 'operation enabled' (statusword 0x{self.statusword:04X}) after it was "
                "commanded to disable: PRESS THE EMERGENCY STOP and check the drive"
            )
        link.send([CanFrame(0, bytes([NMT_PRE_OPERATIONAL, self.config.node]))])
        # It is off and was seen to be: stop watching, or it would report a fault when we fall silent.
        self._agreed.objects.write(cia402.HEARTBEAT_CONSUMER, 1, 0, 4)

    # -- the tick --------------------------------------------------------------------------------

    def _command(self, controlword: int, torque_per_mille: int) -> list[CanFrame]:
        frames = [CanFrame(self._rpdo_id, struct.pack("<Hh", controlword, torque_per_mille))]
        return [*frames, self._sync] if self.settings.sync else frames

    def frames(self, torque_nm: float, now_s: float) -> list[CanFrame]:
        """Set point, SYNC, and the heartbeat when it is due."""
        agreed = self._contacted()
        motor_nm = max(-agreed.peak_nm, min(agreed.peak_nm, self.motor_nm(torque_nm)))
        frames = self._command(cia402.ENABLE_OPERATION, round(motor_nm / agreed.reference_nm * PER_MILLE))
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
        return self._in_nm(per_mille) if enabled else 0.0

    def _in_nm(self, per_mille: int) -> float:
        return self.shaft_nm(per_mille * self._contacted().reference_nm / PER_MILLE)

    def note_sent(self, time_s: float, frame: CanFrame) -> None:
        """A SYNC asks the drive to take up its set point and to stamp it."""
        if frame.identifier == self._sync.identifier:
            self._clock.asked(time_s)

    def off_frames(self) -> Sequence[CanFrame]:
        """Zero torque, then out of operation."""
        return [*self._command(cia402.ENABLE_OPERATION, 0), *self._command(cia402.SHUTDOWN, 0)]

    # -- from the drive --------------------------------------------------------------------------

    @property
    def peak_torque_nm(self) -> float | None:
        """At the shaft."""
        return None if self._agreed is None else abs(self.shaft_nm(self._agreed.peak_nm))

    @property
    def actual_torque_nm(self) -> float | None:
        """0x6077, at the shaft."""
        return None if self._actual is None else self._in_nm(self._actual)

    @property
    def stamps_torque(self) -> bool:
        """True where 0x1013 is mapped beside the actual torque."""
        return self._agreed is not None and self._agreed.stamped

    @property
    def retiming(self) -> ClockRetiming | None:
        """Of its 0x1013."""
        return self._clock.retiming if self.stamps_torque else None

    def receive(self, heard: ReceivedFrame) -> None:
        """Status, actual torque with its time, heartbeat, emergencies."""
        values = self._status.receive(heard)
        if values is None or len(values) < 2 or self._agreed is None:
            return
        self._actual = int.from_bytes(values[:2], "little", signed=True)
        time_s = heard.time_s
        if self._agreed.stamped and len(values) >= 6:
            time_s = self._clock.received(int.from_bytes(values[2:6], "little"), heard.time_s)
        self._reported.append(TorqueSample(time_s, self._in_nm(self._actual)))

    def _why(self) -> str:
        if self._status.new_emergency:
            return self._status.new_emergency
        code = self._contacted().objects.read_if_there(cia402.ERROR_CODE)
        return f"error code 0x{code:04X} {cia402.emergency_in_words(code)}" if code else "no error code given"

    def check(self, now_s: float) -> None:
        """Emergency, state, NMT state, silence."""
        if self._armed:
            self._status.check(now_s)
