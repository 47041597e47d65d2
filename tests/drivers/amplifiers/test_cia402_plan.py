"""Every object dictionary at hand gives a plan or a refusal that says what is missing."""

import pytest

from drivers.amplifiers.canopen_node import read_dictionary
from drivers.amplifiers.cia402_plan import plan_drive, standard_dictionary
from drivers.codecs import cia402
from rig.errors import ConfigError
from sim_backend.emulators.drive import EDS
from tests.drivers.wire import WIRE, needs_captures


def dictionary(name):
    return read_dictionary(WIRE / "eds" / name, 1)


@needs_captures
@pytest.mark.parametrize("name", ["maxon_epos4_50_8.eds", "maxon_epos4_50_15_ec90flat.dcf"])
def test_epos4_needs_its_peak_declared_and_then_runs_cyclic_synchronous_torque(name):
    epos4 = dictionary(name)
    with pytest.raises(ConfigError, match=r"no 0x6072.*peak_torque_nm"):
        plan_drive(epos4, "auto")
    plan = plan_drive(epos4, "auto", peak_is_declared=True)
    assert plan.mode == cia402.CYCLIC_SYNCHRONOUS_TORQUE
    assert plan.has_rated_torque
    assert plan.has_actual_torque
    assert any("limited here to the declared peak" in text for text in plan.fallbacks)
    with pytest.raises(ConfigError, match=r"does not support profile torque.*cyclic synchronous torque"):
        plan_drive(epos4, "profile_torque", peak_is_declared=True)


TORQUE_OBJECTS = (cia402.TARGET_TORQUE, cia402.MAX_TORQUE, cia402.RATED_TORQUE, cia402.ACTUAL_TORQUE)


@needs_captures
@pytest.mark.parametrize(
    ("name", "modes", "torque_objects"),
    [("ros2_fake_cia402.eds", 0xA5, ()), ("pilz_prbt_0_1.dcf", 0x43, (cia402.ACTUAL_TORQUE,))],
)
@pytest.mark.parametrize("wish", ["auto", "cyclic_synchronous_torque", "profile_torque"])
def test_position_drives_are_read_and_refused_for_what_they_lack(name, modes, torque_objects, wish):
    drive = dictionary(name)
    assert drive[cia402.SUPPORTED_MODES].default == modes
    assert tuple(i for i in TORQUE_OBJECTS if i in drive) == torque_objects
    lacks = r"its object dictionary lacks 0x6071 \(target torque\): use a drive with a torque mode"
    with pytest.raises(ConfigError, match=lacks):
        plan_drive(drive, wish, peak_is_declared=True, reference_is_declared=True)
    drive[cia402.TARGET_TORQUE] = standard_dictionary(1)[cia402.TARGET_TORQUE]  # would not make it a torque drive
    with pytest.raises(ConfigError, match=rf"0x6502 = 0x{modes:X}\); of the torque modes it has none"):
        plan_drive(drive, wish, peak_is_declared=True, reference_is_declared=True)


@needs_captures
@pytest.mark.parametrize(
    ("name", "controlword_at", "statusword_at"),
    [
        ("e35_generic.eds", (0x1600, 2), (0x1A00, 2)),
        ("pilz_prbt_0_1.dcf", (0x1600, 1), (0x1A00, 1)),
        ("ros2_fake_cia402.eds", (0x1600, 1), (0x1A00, 1)),
    ],
)
def test_mappings_of_the_file_are_read_as_its_maker_wrote_them(name, controlword_at, statusword_at):
    drive = dictionary(name)
    assert drive[controlword_at[0]][controlword_at[1]].default == 0x60400010
    assert drive[statusword_at[0]][statusword_at[1]].default == 0x60410010
    assert (drive[0x1400][1].default & 0x7FF, drive[0x1800][1].default & 0x7FF) == (0x201, 0x181)  # of node 1


@needs_captures
@pytest.mark.parametrize(
    ("wish", "mode"),
    [
        ("auto", cia402.CYCLIC_SYNCHRONOUS_TORQUE),
        ("cyclic_synchronous_torque", cia402.CYCLIC_SYNCHRONOUS_TORQUE),
        ("profile_torque", cia402.PROFILE_TORQUE),
    ],
)
def test_generic_drive_has_both_torque_modes_and_every_torque_object_and_no_time_stamp(wish, mode):
    drive = dictionary("e35_generic.eds")
    assert all(i in drive for i in (*TORQUE_OBJECTS, cia402.TORQUE_SLOPE))
    plan = plan_drive(drive, wish)
    assert plan.mode == mode
    assert (plan.has_max_torque, plan.has_rated_torque, plan.has_actual_torque, plan.has_torque_slope) == (True,) * 4
    assert [text.partition(":")[0] for text in plan.fallbacks] == ["no 0x1013 (time stamp)"]


def test_own_emulated_drive_has_everything():
    plan = plan_drive(read_dictionary(EDS, 1), "auto")
    assert (plan.mode, plan.fallbacks) == (cia402.CYCLIC_SYNCHRONOUS_TORQUE, ())


def test_what_the_drive_itself_says_of_its_modes_counts_more_than_the_file():
    plan = plan_drive(read_dictionary(EDS, 1), "auto", supported_modes=1 << 3)
    assert plan.mode_name == "profile torque"
    with pytest.raises(ConfigError, match="0x6502 = 0x1"):
        plan_drive(read_dictionary(EDS, 1), "auto", supported_modes=1)


def test_drive_without_target_torque_is_refused():
    od = standard_dictionary(1)
    del od[cia402.TARGET_TORQUE]
    with pytest.raises(ConfigError, match=r"lacks 0x6071 \(target torque\)"):
        plan_drive(od, "auto")


def test_drive_without_rated_torque_needs_a_reference():
    od = standard_dictionary(1)
    del od[cia402.RATED_TORQUE]
    with pytest.raises(ConfigError, match="reference_torque_nm"):
        plan_drive(od, "auto")
    assert not plan_drive(od, "auto", reference_is_declared=True).has_rated_torque


def test_drive_without_actual_torque_falls_back_to_what_was_sent():
    od = standard_dictionary(1)
    del od[cia402.ACTUAL_TORQUE]
    assert any("torque sent is recorded" in text for text in plan_drive(od, "auto").fallbacks)
