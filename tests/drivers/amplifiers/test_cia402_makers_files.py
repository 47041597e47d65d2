"""The whole first contact with a maker's file in the settings, and at the other end a node with just its objects."""

import pytest

import drivers.transport.can_link
from drivers.amplifiers import make_amplifier
from drivers.codecs import cia402
from drivers.transport.can_link import CanLink
from rig.config.bench import AmplifierConfig
from rig.errors import ConfigError, DeviceFault
from sim_backend.emulators.canopen_node import CanopenNode
from tests.drivers.emulated_bus import EmulatedBus, FakeTime
from tests.drivers.wire import WIRE, needs_captures

MODES_OF_AN_EPOS4 = 0x3A5  # as its firmware says; the DCF leaves the value out


@pytest.fixture(autouse=True)
def no_sleeping(monkeypatch):
    monkeypatch.setattr(drivers.transport.can_link.time, "sleep", lambda s: None)


class Contact:
    """The driver told of a file, and a node that has the objects of the file and no others."""

    def __init__(self, name, **settings):
        self.node = CanopenNode(WIRE / "eds" / name, 5)
        self.bus = EmulatedBus(self.node, FakeTime())
        self.link = CanLink(self.bus, self.bus.time)
        settings = {"eds": str(WIRE / "eds" / name), **settings}
        self.amplifier = make_amplifier(AmplifierConfig(node=5, settings=settings))

    def notes(self):
        try:
            return self.amplifier.contact(self.link)
        finally:
            self.link.close()


@needs_captures
@pytest.mark.parametrize("name", ["maxon_epos4_50_8.eds", "maxon_epos4_50_15_ec90flat.dcf"])
def test_an_epos4_is_remapped_watched_and_limited_to_the_declared_peak(name):
    contact = Contact(name, peak_torque_nm=0.8, reference_torque_nm=0.5)
    od = contact.node.od
    od.set(cia402.SUPPORTED_MODES, MODES_OF_AN_EPOS4)
    notes = contact.notes()
    assert notes[0] == "cyclic synchronous torque, steps of 0.0005 N m, peak 0.8 N m"
    assert "watchdog of 100 ms set in the drive and read back" in notes
    assert "no 0x6072 (max torque): the command is limited here to the declared peak torque" in notes
    assert [od.get(0x1600, k) for k in range(3)] == [2, 0x60400010, 0x60710010]
    assert [od.get(0x1A00, k) for k in range(3)] == [2, 0x60410010, 0x60770010]
    assert od.get(0x1016, 1) == 127 << 16 | 100
    assert od.get(cia402.MODE) == cia402.CYCLIC_SYNCHRONOUS_TORQUE


@needs_captures
def test_an_epos4_without_a_scale_is_not_guessed_at():
    contact = Contact("maxon_epos4_50_8.eds", peak_torque_nm=0.8)  # its file has 0x6076 = 0
    with pytest.raises(DeviceFault, match=r"0x6076 \(rated torque\) is 0.*reference_torque_nm"):
        contact.notes()


@needs_captures
@pytest.mark.parametrize("name", ["pilz_prbt_0_1.dcf", "ros2_fake_cia402.eds"])
def test_a_position_drive_is_refused_by_its_file_before_anything_is_opened(name):
    with pytest.raises(
        ConfigError, match=rf"^bench.amplifier.settings.eds: .*{name}: .* lacks 0x6071 \(target torque\)"
    ):
        Contact(name, peak_torque_nm=1.0, reference_torque_nm=1.0)
