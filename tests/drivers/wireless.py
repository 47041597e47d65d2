"""A bench without wires: the bytes of an emulated gyro, and an emulated drive."""

import math

import drivers.bench.devices
from drivers.bench import BenchRig
from drivers.codecs import stim300
from rig.config.bench import AmplifierConfig, BenchConfig, CanConfig, GyroscopeConfig, RealTimeConfig
from rig.errors import DeviceFault
from rig.interface import Torque
from sim_backend.emulators.drive import Cia402Drive
from tests.drivers.emulated_bus import EmulatedBus, FakeTime, LookedAt

CONFIG = BenchConfig(
    gyroscope=GyroscopeConfig(port="wire", settings={"datagram": 0x90}),
    amplifier=AmplifierConfig(can=CanConfig(channel="bus")),
    real_time=RealTimeConfig(priority=0, lock_memory=False),
    settle_s=1.0,
)


class GyroPort:
    """A STIM300 whose datagrams appear as time passes; every tenth read is cut in the middle."""

    name = "wire"

    def __init__(self, time):
        self.time, self.sent, self.begin_s, self.rest = time, 0, time.now_s, b""
        self.vanished = False

    def fileno(self):
        return None

    def read(self):
        if self.vanished:
            raise DeviceFault("wire has vanished (test)")
        due = int((self.time.now_s - self.begin_s) * 2000)
        data = self.rest
        for k in range(self.sent, due):
            word = round(100 * math.sin(k / 100) / stim300.RATE_LSB_DEG_S)
            data += stim300.encode_datagram(stim300.Datagram(0x90, (0, 0, word), 0, k & 255, 506))
        self.sent = due
        keep = 7 if due % 10 == 0 and len(data) > 7 else 0
        data, self.rest = data[: len(data) - keep], data[len(data) - keep :]
        return data

    def write(self, data, timeout_s=0.1):
        pass

    def wait_readable(self, timeout_s):
        self.time.now_s += timeout_s
        return True

    def close(self):
        pass


def wireless_bench(monkeypatch, folder):
    time = FakeTime()
    drive = Cia402Drive(1, 100.0, 150.0)
    monkeypatch.setattr(drivers.bench.devices, "open_bus", lambda config, clock: EmulatedBus(drive, time))
    monkeypatch.setattr(drivers.bench.devices, "listening", lambda port, clock: port)
    monkeypatch.setattr(drivers.bench.devices, "open_port", lambda path, baud: GyroPort(time))
    rig = BenchRig(CONFIG, Torque.EMULATED, folder / "raw", LookedAt(time))
    rig.time, rig.drive = time, drive
    return rig


def play(rig, ticks, torque=lambda k: 10 * math.sin(k / 20)):
    return [rig.exchange(rig.clock.now_s(), torque(k)) for k in range(ticks)]


def played_in_two_sets(bench):
    """A rest, a whole set, a rest, and a set that a kill cuts short; what came in during each set, and its start."""
    found = []
    with bench.opened(), bench.armed():
        for ticks in (400, 300):
            play(bench, 30, lambda k: 0.0)
            start_s = bench.clock.now_s()
            bench.begin_set(math.sin, start_s)
            found.append((start_s, play(bench, ticks)))
            if ticks == 400:
                bench.end_set()
    return found
