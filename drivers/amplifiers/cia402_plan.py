"""The abilities of a CiA 402 drive (modes, limits, optional objects), read from its object dictionary.

Makers leave objects out (the EPOS4 has no 0x6072 and no 0x6075) and differ in what a torque of 1000 means.
The plan says which mode is used, what is missing and what takes its place; or refuses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import canopen
from canopen.objectdictionary import ODRecord, ODVariable, datatypes

from drivers.codecs import cia402
from rig.errors import ConfigError

ModeWish = Literal["auto", "cyclic_synchronous_torque", "profile_torque"]
_WISHES = {
    "auto": (cia402.CYCLIC_SYNCHRONOUS_TORQUE, cia402.PROFILE_TORQUE),
    "cyclic_synchronous_torque": (cia402.CYCLIC_SYNCHRONOUS_TORQUE,),
    "profile_torque": (cia402.PROFILE_TORQUE,),
}


@dataclass(frozen=True)
class DrivePlan:
    """How a drive will be commanded.

    ``fallbacks`` says in words what is missing in the drive and what is done instead.
    """

    mode: int
    has_actual_torque: bool
    has_max_torque: bool
    has_rated_torque: bool
    has_torque_slope: bool
    has_time_stamp: bool
    fallbacks: tuple[str, ...] = field(default=())

    @property
    def mode_name(self) -> str:
        return cia402.MODE_NAMES[self.mode]


def plan_drive(
    dictionary: canopen.ObjectDictionary,
    wish: ModeWish,
    supported_modes: int | None = None,
    peak_is_declared: bool = False,
    reference_is_declared: bool = False,
) -> DrivePlan:
    """A plan for the drive that this dictionary describes.

    Parameters
    ----------
    supported_modes
        0x6502 as the drive itself says; the file's default where None.
    peak_is_declared, reference_is_declared
        Whether the settings give the peak torque, and what 1000 in 0x6071 means.

    Raises
    ------
    ConfigError
        If the drive cannot take torque this way, with what is missing.
    """
    missing = [i for i in (cia402.CONTROLWORD, cia402.STATUSWORD, cia402.MODE) if i not in dictionary]
    if cia402.TARGET_TORQUE not in dictionary:
        missing.append(cia402.TARGET_TORQUE)
    if missing:
        raise ConfigError(
            f"this drive cannot be commanded by torque: its object dictionary lacks {_names(missing)}: use a drive "
            "with a torque mode, or give the EDS file of this drive (bench.amplifier.settings.eds)"
        )
    has = {i: i in dictionary for i in (cia402.MAX_TORQUE, cia402.RATED_TORQUE, cia402.ACTUAL_TORQUE)}
    mode, mode_note = _choose_mode(dictionary, wish, supported_modes)
    fallbacks = [mode_note] if mode_note else []
    if cia402.TIME_STAMP not in dictionary:
        fallbacks.append("no 0x1013 (time stamp): a set point counts from the instant at which it was sent")
    if not has[cia402.MAX_TORQUE]:
        if not peak_is_declared:
            raise ConfigError(
                "this drive has no 0x6072 (max torque), so its peak torque must be declared: set "
                "bench.amplifier.settings.peak_torque_nm (motor side) to what its current limit allows"
            )
        fallbacks.append("no 0x6072 (max torque): the command is limited here to the declared peak torque")
    if not has[cia402.RATED_TORQUE] and not reference_is_declared:
        raise ConfigError(
            "this drive has no 0x6076 (rated torque): set bench.amplifier.settings.reference_torque_nm to the "
            "torque that 1000 in 0x6071 stands for"
        )
    if not has[cia402.ACTUAL_TORQUE]:
        fallbacks.append("no 0x6077 (actual torque): the torque sent is recorded, not the torque measured")
    return DrivePlan(
        mode,
        has[cia402.ACTUAL_TORQUE],
        has[cia402.MAX_TORQUE],
        has[cia402.RATED_TORQUE],
        cia402.TORQUE_SLOPE in dictionary,
        cia402.TIME_STAMP in dictionary,
        tuple(fallbacks),
    )


def _choose_mode(dictionary: canopen.ObjectDictionary, wish: ModeWish, supported_modes: int | None) -> tuple[int, str]:
    wanted = _WISHES[wish]
    bits = supported_modes if supported_modes is not None else _default(dictionary, cia402.SUPPORTED_MODES)
    if bits is None:
        return wanted[0], f"no 0x6502 (supported modes): {cia402.MODE_NAMES[wanted[0]]} is assumed"
    for mode in wanted:
        if bits & cia402.MODE_BITS[mode]:
            return mode, ""
    able = [name for mode, name in cia402.MODE_NAMES.items() if bits & cia402.MODE_BITS[mode]]
    names = " or ".join(cia402.MODE_NAMES[mode] for mode in wanted)
    raise ConfigError(
        f"this drive does not support {names} (0x6502 = 0x{bits:X}); of the torque modes it has "
        f"{', '.join(able) or 'none'}: change bench.amplifier.settings.mode or the drive"
    )


def _default(dictionary: canopen.ObjectDictionary, index: int) -> int | None:
    if index not in dictionary:
        return None
    variable = dictionary[index]
    value = getattr(variable, "value", None)
    value = value if value is not None else getattr(variable, "default", None)
    return int(value) if isinstance(value, int) and value else None


def _names(indices: Sequence[int]) -> str:
    words = {
        cia402.CONTROLWORD: "0x6040 (controlword)",
        cia402.STATUSWORD: "0x6041 (statusword)",
        cia402.MODE: "0x6060 (mode of operation)",
        cia402.TARGET_TORQUE: "0x6071 (target torque)",
    }
    return ", ".join(words[index] for index in indices)


def standard_dictionary(node: int) -> canopen.ObjectDictionary:
    """The objects of the profile that this driver uses, for a drive without an EDS at hand."""
    od = canopen.ObjectDictionary()
    od.node_id = node
    for index, name, kind in (
        (cia402.CONTROLWORD, "Controlword", datatypes.UNSIGNED16),
        (cia402.STATUSWORD, "Statusword", datatypes.UNSIGNED16),
        (cia402.MODE, "Modes of operation", datatypes.INTEGER8),
        (cia402.MODE_DISPLAY, "Modes of operation display", datatypes.INTEGER8),
        (cia402.TARGET_TORQUE, "Target torque", datatypes.INTEGER16),
        (cia402.MAX_TORQUE, "Max torque", datatypes.UNSIGNED16),
        (cia402.RATED_TORQUE, "Motor rated torque", datatypes.UNSIGNED32),
        (cia402.ACTUAL_TORQUE, "Torque actual value", datatypes.INTEGER16),
        (cia402.TORQUE_SLOPE, "Torque slope", datatypes.UNSIGNED32),
        (cia402.TIME_STAMP, "High resolution time stamp", datatypes.UNSIGNED32),
    ):
        od.add_object(_variable(name, index, 0, kind))
    for k in range(4):
        for base, cob in ((0x1400, 0x200), (0x1800, 0x180)):
            od.add_object(_communication(base + k, cob + 0x100 * k + node))
            od.add_object(_mapping(base + 0x200 + k))
    return od


def _variable(name: str, index: int, subindex: int, kind: int, default: int = 0) -> ODVariable:
    variable = ODVariable(name, index, subindex)
    variable.data_type = kind
    variable.access_type = "rw"
    variable.default = default
    return variable


def _communication(index: int, cob_id: int) -> Any:
    record = ODRecord(f"PDO communication 0x{index:04X}", index)
    record.add_member(_variable("Highest sub-index", index, 0, datatypes.UNSIGNED8, 2))
    record.add_member(_variable("COB-ID", index, 1, datatypes.UNSIGNED32, cob_id))
    record.add_member(_variable("Transmission type", index, 2, datatypes.UNSIGNED8, 255))
    return record


def _mapping(index: int) -> Any:
    record = ODRecord(f"PDO mapping 0x{index:04X}", index)
    record.add_member(_variable("Number of mapped objects", index, 0, datatypes.UNSIGNED8))
    for subindex in range(1, 9):
        record.add_member(_variable(f"Object {subindex}", index, subindex, datatypes.UNSIGNED32))
    return record
