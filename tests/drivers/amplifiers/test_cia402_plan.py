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


@needs_captures
@pytest.mark.parametrize(
    "name",
    ["e35_generic.eds", "ros2_fake_cia402.eds", "pilz_prbt_0_1.dcf"],
)
def test_other_files_give_a_plan_or_a_refusal_that_names_what_is_missing(name):
    try:
        plan = plan_drive(dictionary(name), "auto")
    except ConfigError as refusal:
        assert "0x60" in str(refusal) or "0x65" in str(refusal)
    else:
        assert plan.mode in cia402.MODE_NAMES


@needs_captures
def test_generic_drive_has_everything():
    plan = plan_drive(dictionary("e35_generic.eds"), "auto")
    assert plan.has_max_torque
    assert plan.has_actual_torque


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
