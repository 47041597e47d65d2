"""Setup of a CiA 402 drive before it may be enabled: scale, watchdog (heartbeat consumer), PDO maps, mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from drivers.amplifiers.canopen_node import RemoteObjects, read_dictionary
from drivers.amplifiers.cia402_plan import DrivePlan, ModeWish, plan_drive, standard_dictionary
from drivers.codecs import cia402
from drivers.codecs.lawicel import CanFrame
from drivers.settings import Settings
from drivers.transport.can_link import CanLink
from rig.errors import ConfigError, DeviceFault

NMT_START, NMT_PRE_OPERATIONAL = 0x01, 0x80
SYNCHRONOUS, EVENT_DRIVEN = 1, 255
PER_MILLE = 1000
ERROR_BEHAVIOUR, TO_PRE_OPERATIONAL, STAYS_OPERATIONAL = 0x1029, 0, 1
COMMAND_LIMIT = 32_767
TPDO = 0x1800  # communication parameters of the first one
NO_REMOTE_REQUEST = 1 << 30  # of a PDO's COB-ID (CiA 301, 7.5.2.37)
OPTIONAL_OBJECTS = (
    cia402.MAX_TORQUE,
    cia402.RATED_TORQUE,
    cia402.ACTUAL_TORQUE,
    cia402.TORQUE_SLOPE,
    cia402.TIME_STAMP,
)


class Cia402Settings(Settings):
    """What differs between makers.

    A torque of 1000 in 0x6071 means ``reference_torque_nm`` at the motor; where that is left out, 0x6076 in units of
    ``rated_torque_unit_nm`` (0.001 by the profile; some maxon files only make sense in 1e-6).
    """

    eds: str | None = None
    """The maker's EDS or DCF, relative to where the command is run; without it the profile's objects are assumed."""
    mode: ModeWish = "auto"
    """Mode of operation in which the drive takes torque."""
    reference_torque_nm: Annotated[float, Field(gt=0)] | None = None
    """Torque of the motor that 1000 in 0x6071 means, N m; from 0x6076 if left out."""
    rated_torque_unit_nm: Annotated[float, Field(gt=0)] = 1e-3
    """Unit of 0x6076, N m."""
    peak_torque_nm: Annotated[float, Field(gt=0)] | None = None
    """Largest torque of the motor, N m; needed where the drive has no 0x6072."""
    sync: bool = True
    """false: the drive acts on each frame at once; true: on the next SYNC."""
    on_lost_host: Annotated[int, Field(ge=1, le=3)] = 1
    """Written to 0x6007: 1 fault, 2 disable voltage, 3 quick stop."""
    host_node: Annotated[int, Field(ge=1, le=127)] = 127
    """This computer's node number."""
    drive_heartbeat_ms: Annotated[int, Field(ge=5, le=5000)] = 50
    """Interval of the drive's own heartbeat, ms."""
    sdo_timeout_ms: Annotated[float, Field(ge=10, le=10_000)] = 300.0
    """Longest wait for an SDO answer, ms."""
    state_timeout_ms: Annotated[float, Field(ge=50, le=30_000)] = 1500.0
    """Longest wait for a change of state, ms."""


@dataclass(frozen=True)
class AgreedSetup:
    """What was found out and set: torques at the motor; ``stamped`` where 0x1013 comes with the torque."""

    objects: RemoteObjects
    plan: DrivePlan
    reference_nm: float
    peak_nm: float
    stamped: bool
    notes: tuple[str, ...]


class Cia402Setup:
    """Reads a drive and sets it up; it stays disabled.

    Parameters
    ----------
    settings, node, watchdog_ms
        As configured.
    label
        What messages call the drive.
    """

    def __init__(self, settings: Cia402Settings, node: int, watchdog_ms: int, label: str) -> None:
        self._settings, self._node, self._watchdog_ms, self._label = settings, node, watchdog_ms, label

    def dictionary(self) -> Any:
        """The objects that the maker's file says the drive has. Raises ConfigError where they are too few."""
        s = self._settings
        if s.eds is None:
            return standard_dictionary(self._node)
        found = read_dictionary(Path(s.eds), self._node)
        try:
            self._plan(found, None)
        except ConfigError as error:
            raise ConfigError(f"bench.amplifier.settings.eds: {s.eds}: {error}") from None
        return found

    def run(self, link: CanLink) -> AgreedSetup:
        """All of it. Raises DeviceFault where the drive does not answer or cannot do what is needed."""
        s, node = self._settings, self._node
        dictionary = self.dictionary()
        objects = RemoteObjects(link, node, dictionary, s.sdo_timeout_ms * 1e-3, self._label)
        link.send([CanFrame(0, bytes([NMT_PRE_OPERATIONAL, node]))])
        profile = objects.read(0x1000) & 0xFFFF
        modes = objects.read_if_there(cia402.SUPPORTED_MODES)
        plan = self._plan(self._present(dictionary, objects), modes)
        reference_nm, peak_nm = self._scale(objects, plan)
        self.watch(objects)
        stamped = self._map(objects, plan)
        objects.write(cia402.MODE, 0, plan.mode, 1)
        link.send([CanFrame(0, bytes([NMT_START, node]))])
        notes = (*plan.fallbacks, *([] if profile == 402 else [f"0x1000 says profile {profile}, not 402"]))
        return AgreedSetup(objects, plan, reference_nm, peak_nm, stamped, notes)

    def _plan(self, dictionary: Any, modes: int | None) -> DrivePlan:
        s = self._settings
        peak_given, reference_given = s.peak_torque_nm is not None, s.reference_torque_nm is not None
        return plan_drive(dictionary, s.mode, modes, peak_given, reference_given)

    def _present(self, dictionary: Any, objects: RemoteObjects) -> Any:
        """Without an EDS, leave out what this drive turns out not to have."""
        if self._settings.eds is None:
            for index in OPTIONAL_OBJECTS:
                if objects.read_if_there(index) is None:
                    del dictionary[index]
        return dictionary

    def _scale(self, objects: RemoteObjects, plan: DrivePlan) -> tuple[float, float]:
        """Torque that a command of 1000 stands for, and the largest that may be commanded."""
        s = self._settings
        reference = s.reference_torque_nm
        if reference is None:
            reference = objects.read(cia402.RATED_TORQUE) * s.rated_torque_unit_nm
        if reference <= 0.0:
            raise DeviceFault(
                f"{self._label}: 0x6076 (rated torque) is 0, so a command has no scale: commission the drive, or "
                "set bench.amplifier.settings.reference_torque_nm"
            )
        peak = s.peak_torque_nm
        if plan.has_max_torque:
            own = objects.read(cia402.MAX_TORQUE) * reference / PER_MILLE
            peak = own if peak is None else min(peak, own)
        assert peak is not None  # the plan refuses a drive that leaves it open
        return reference, min(peak, COMMAND_LIMIT * reference / PER_MILLE)

    def watch(self, objects: RemoteObjects) -> None:
        """Set the drive to watch our heartbeat, and read back that it does; refuse if it cannot."""
        s = self._settings
        wanted = s.host_node << 16 | self._watchdog_ms
        objects.write(cia402.HEARTBEAT_PRODUCER, 0, s.drive_heartbeat_ms, 2)
        objects.write(cia402.HEARTBEAT_CONSUMER, 1, wanted, 4)
        if objects.read(cia402.HEARTBEAT_CONSUMER, 1) != wanted:
            raise DeviceFault(
                f"{self._label} did not accept the heartbeat consumer (0x1016:01), so it would keep driving if this "
                "computer fails. It is refused: use a drive or firmware that has a heartbeat consumer."
            )
        if objects.read_if_there(cia402.ABORT_CONNECTION_OPTION) is not None:
            objects.write(cia402.ABORT_CONNECTION_OPTION, 0, s.on_lost_host, 2)
            if objects.read(cia402.ABORT_CONNECTION_OPTION, signed=True) == 0:
                raise DeviceFault(
                    f"{self._label}: 0x6007 (reaction to a lost connection) stays 0, so the drive would keep "
                    "driving if this computer fails. It is refused: use another drive or firmware."
                )
        else:
            self._leave_operational_when_lost(objects)

    def _leave_operational_when_lost(self, objects: RemoteObjects) -> None:
        """Without 0x6007 it has to leave NMT operational, which no torque outlives; refuse where that is not so."""
        behaviour = objects.read_if_there(ERROR_BEHAVIOUR, 1)
        if behaviour == STAYS_OPERATIONAL:
            objects.write(ERROR_BEHAVIOUR, 1, TO_PRE_OPERATIONAL, 1)
            behaviour = objects.read(ERROR_BEHAVIOUR, 1)
        if behaviour is None or behaviour == STAYS_OPERATIONAL:
            raise DeviceFault(
                f"{self._label} has no 0x6007 and "
                + ("no 0x1029" if behaviour is None else "its 0x1029:01 stays 1 (no change)")
                + (
                    ", so it would not cut the torque if this computer fails. It is refused: use another drive or "
                    "firmware."
                )
            )

    def _map(self, objects: RemoteObjects, plan: DrivePlan) -> bool:
        """Both PDOs; True where the drive stamps its torque."""
        sync = self._settings.sync
        kind = SYNCHRONOUS if sync else EVENT_DRIVEN
        rpdo = objects.remote.rpdo[1]
        _remap(rpdo, 0x200 + self._node, kind, (cia402.CONTROLWORD, cia402.TARGET_TORQUE))
        objects.save_pdo(rpdo, "RPDO 1 (controlword, target torque)")
        reported = (cia402.STATUSWORD,) + ((cia402.ACTUAL_TORQUE,) if plan.has_actual_torque else ())
        stamped = plan.has_time_stamp and plan.has_actual_torque and sync
        if stamped:
            stamped = self._map_status(objects, kind, (*reported, cia402.TIME_STAMP), may_refuse=True)
        if not stamped:
            self._map_status(objects, kind, reported)
        if not sync and objects.read_if_there(TPDO, 5) is not None:
            objects.write(TPDO, 5, 10, 2)
        return stamped

    def _map_status(self, objects: RemoteObjects, kind: int, indices: Sequence[int], may_refuse: bool = False) -> bool:
        """Map what the drive reports; False where it refuses and may (0x1013 need not be mappable)."""
        tpdo = objects.remote.tpdo[1]
        # A drive that answers no remote requests refuses to have the bit cleared that says so.
        answers_requests = not (objects.read_if_there(TPDO, 1) or 0) & NO_REMOTE_REQUEST
        _remap(tpdo, 0x180 + self._node, kind, indices, answers_requests)
        try:
            objects.save_pdo(tpdo, "TPDO 1 (statusword, actual torque)")
        except DeviceFault:
            if not may_refuse:
                raise
            return False
        return True


def _remap(pdo: Any, cob_id: int, kind: int, indices: Sequence[int], answers_requests: bool = True) -> None:
    """Lay a PDO out anew."""
    pdo.clear()
    for index in indices:
        pdo.add_variable(index)
    pdo.cob_id, pdo.trans_type, pdo.enabled, pdo.rtr_allowed = cob_id, kind, True, answers_requests
    pdo.event_timer = pdo.inhibit_time = pdo.sync_start_value = None
