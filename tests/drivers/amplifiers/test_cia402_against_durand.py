"""The CiA 402 driver against a CANopen slave that others wrote (durand), through bytes of a Lawicel adapter."""

import pytest

import drivers.transport.can_link
from drivers.amplifiers import make_amplifier
from drivers.codecs import cia402
from drivers.codecs.cia402 import State
from drivers.codecs.lawicel import CanFrame
from drivers.transport.can_link import CanLink
from drivers.transport.slcan import SlcanBulkBus
from rig.config.bench import AmplifierConfig
from rig.errors import DeviceFault
from tests.drivers.emulated_bus import FakeTime
from tests.drivers.fake_port import AdapterPort

durand = pytest.importorskip("durand", reason="durand, a CANopen slave by others, is in the extra `test`")
DT = durand.DatatypeEnum
NODE = 9


class WireNetwork(durand.network.NetworkABC):
    """durand's side of the bus: its frames become bytes of the adapter, without a thread."""

    def __init__(self, to_host) -> None:
        self.to_host, self.subscriptions = to_host, {}

    def add_subscription(self, cob_id, callback):
        self.subscriptions[cob_id] = callback

    def remove_subscription(self, cob_id):
        self.subscriptions.pop(cob_id)

    def send(self, cob_id, msg):
        self.to_host(CanFrame(cob_id, bytes(msg)))

    def hear(self, frame):
        callback = self.subscriptions.get(frame.identifier)
        if callback is not None:
            callback(frame.identifier, frame.data)


class Slave:
    """A torque drive's application on durand's protocol stack."""

    def __init__(self) -> None:
        self.time = FakeTime()
        self.scheduler = durand.scheduler.VirtualScheduler()
        durand.set_scheduler(self.scheduler)
        self.port = AdapterPort(on_frame=self.hear)
        self.network = WireNetwork(self.to_host)
        self.node = durand.MinimalNode(self.network, NODE)
        self._ran_s = self.time.now_s
        od = self.node.object_dictionary
        for index, kind, value in (
            (cia402.ABORT_CONNECTION_OPTION, DT.INTEGER16, 3),
            (cia402.ERROR_CODE, DT.UNSIGNED16, 0),
            (cia402.CONTROLWORD, DT.UNSIGNED16, 0),
            (cia402.STATUSWORD, DT.UNSIGNED16, 0x240),
            (cia402.MODE, DT.INTEGER8, 0),
            (cia402.MODE_DISPLAY, DT.INTEGER8, 0),
            (cia402.TARGET_TORQUE, DT.INTEGER16, 0),
            (cia402.MAX_TORQUE, DT.UNSIGNED16, 2000),
            (cia402.RATED_TORQUE, DT.UNSIGNED32, 50_000),
            (cia402.ACTUAL_TORQUE, DT.INTEGER16, 0),
            (cia402.SUPPORTED_MODES, DT.UNSIGNED32, 1 << 9),
        ):
            od[index] = durand.Variable(kind, "rw", value, name=f"0x{index:04X}")
        od[0x1000] = durand.Variable(DT.UNSIGNED32, "ro", 0x20192, name="Device Type")
        od[0x1016] = durand.object_dictionary.Array(
            durand.Variable(DT.UNSIGNED32, "rw", 0), length=1, name="Consumer heartbeat time"
        )
        od.update_callbacks[cia402.CONTROLWORD, 0].add(self.follow)
        od.update_callbacks[cia402.MODE, 0].add(lambda mode: od.write(cia402.MODE_DISPLAY, 0, mode))
        od.update_callbacks[cia402.TARGET_TORQUE, 0].add(lambda t: od.write(cia402.ACTUAL_TORQUE, 0, t))
        keep = self.port.read
        self.port.read = lambda: (self.let_time_pass(), keep())[1]

    def hear(self, frame):
        self.network.hear(frame)

    def to_host(self, frame):
        self.port.waiting += self.port.adapter.to_host(frame)

    def let_time_pass(self):
        passed_s, self._ran_s = self.time.now_s - self._ran_s, self.time.now_s
        self.scheduler.run(passed_s)

    def follow(self, controlword):
        od = self.node.object_dictionary
        steps = {
            cia402.DISABLE_VOLTAGE: State.SWITCH_ON_DISABLED,
            cia402.SHUTDOWN: State.READY,
            cia402.SWITCH_ON: State.SWITCHED_ON,
            cia402.ENABLE_OPERATION: State.ENABLED,
        }
        if controlword in steps:
            od.write(cia402.STATUSWORD, 0, cia402.statusword_of(steps[controlword]))

    def value(self, index, subindex=0):
        return self.node.object_dictionary.read(index, subindex)


@pytest.fixture
def slave(monkeypatch):
    monkeypatch.setattr(drivers.transport.can_link.time, "sleep", lambda s: None)
    return Slave()


@pytest.fixture
def link(slave):
    link = CanLink(SlcanBulkBus(slave.port), slave.time)
    yield link
    slave.port.mute = False
    link.close()


def make(**settings):
    return make_amplifier(AmplifierConfig(node=NODE, settings=settings))


def tick(link, amplifier, slave, torque_nm):
    now_s = slave.time()
    link.send(amplifier.frames(torque_nm, now_s))
    link.poll()
    amplifier.check(now_s)


def test_whole_life_from_nmt_to_torque_and_back(slave, link):
    amplifier = make()
    notes = amplifier.contact(link)
    assert notes[0] == "cyclic synchronous torque, steps of 0.05 N m, peak 100 N m"
    assert slave.value(0x1016, 1) == 127 << 16 | 100
    assert [slave.value(0x1600, k) for k in (0, 1, 2)] == [2, 0x60400010, 0x60710010]
    assert [slave.value(0x1A00, k) for k in (0, 1, 2)] == [2, 0x60410010, 0x60770010]
    amplifier.arm(link)
    assert slave.node.nmt.state == durand.services.nmt.StateEnum.OPERATIONAL
    assert amplifier.state is State.ENABLED
    for _ in range(3):
        tick(link, amplifier, slave, 12.52)
    assert slave.value(cia402.TARGET_TORQUE) == 250
    assert amplifier.actual_torque_nm == pytest.approx(12.5)
    amplifier.disarm(link)
    assert slave.value(cia402.TARGET_TORQUE) == 0
    assert slave.value(cia402.STATUSWORD) == cia402.statusword_of(State.SWITCH_ON_DISABLED)


def test_heartbeat_of_the_slave_is_heard_and_its_absence_noticed(slave, link):
    amplifier = make()
    amplifier.contact(link)
    amplifier.arm(link)
    for _ in range(600):
        tick(link, amplifier, slave, 1.0)
    slave.let_time_pass = lambda: None  # its scheduler stops: no heartbeat any more
    with pytest.raises(DeviceFault, match="is silent: no heartbeat"):
        for _ in range(2000):
            tick(link, amplifier, slave, 1.0)


def test_emergency_of_the_slave_is_told_in_words(slave, link):
    amplifier = make()
    amplifier.contact(link)
    amplifier.arm(link)
    slave.node.emcy.set(0x2310, 0)
    with pytest.raises(DeviceFault, match="0x2310 continuous over-current"):
        tick(link, amplifier, slave, 1.0)


def test_abort_of_the_slave_is_told_with_object_and_reason(slave, link):
    del slave.node.object_dictionary._objects[0x1016]
    with pytest.raises(DeviceFault, match=r"refuses to write 0x1016:01: .*0x06020000"):
        make().contact(link)


def test_slave_without_actual_and_max_torque_is_run_without_them(slave, link):
    for index in (cia402.ACTUAL_TORQUE, cia402.MAX_TORQUE):
        del slave.node.object_dictionary._variables[index]
    amplifier = make(peak_torque_nm=80.0)
    notes = amplifier.contact(link)
    assert any("no 0x6077" in note for note in notes)
    assert slave.value(0x1A00, 0) == 1
    amplifier.arm(link)
    tick(link, amplifier, slave, 5.0)
    assert amplifier.actual_torque_nm is None
    assert amplifier.peak_torque_nm == pytest.approx(80.0)
