"""The bench as a rig: contact, faults, and what it says of its devices and their clocks."""

import pytest

import drivers.bench.devices
from drivers.bench.retiming import BenchRetiming
from rig.errors import Aborted, DeviceFault
from tests.drivers.wireless import CONFIG, GyroPort, play


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("auto", "torque as the drive reports it, stamped by its own clock"),
        ("sent", "torque timed when it was sent"),
    ],
)
def test_what_is_taken_off_both_roads_is_told_and_no_delay_expected(bench, source, told):
    with bench.opened(), bench.armed():
        play(bench, 50)
        chosen = bench.amplifier.config.model_copy(update={"torque_source": source})
        expected = BenchRetiming(chosen, bench.gyroscope, bench.amplifier).expected_delay()
    assert expected.delay_s == 0.0
    assert expected.corrections[0] == "gyro group delay 2.2 ms"
    assert expected.corrections[-1] == told


def test_vanished_gyro_stops_the_next_tick_before_any_torque(bench):
    with bench.opened(), pytest.raises(DeviceFault, match="wire has vanished"), bench.armed():
        play(bench, 20, lambda k: 5.0)
        assert bench.drive.torque_nm == 5.0
        bench._devices.line._port.vanished = True
        with pytest.raises(DeviceFault):
            bench.exchange(bench.time(), 5.0)
        bench.exchange(bench.time(), 7.0)
    assert bench.drive.torque_nm == 0.0


def test_all_that_is_wrong_is_listed_at_once(bench, monkeypatch):
    class Silent(GyroPort):
        def read(self):
            return b""

    monkeypatch.setattr(drivers.bench.devices, "open_port", lambda path, baud: Silent(bench.time))
    bench.drive.receive = lambda frame, now_s: None
    with pytest.raises(DeviceFault, match=r"(?s)2 faults on the bench.*does not answer.*no byte in 1"), bench.opened():
        pass


def test_who_stops_it_while_devices_are_contacted_is_no_fault_of_a_device(bench, monkeypatch):
    def stopped(path, baud):
        raise Aborted("Stopped by Ctrl-C.")

    monkeypatch.setattr(drivers.bench.devices, "open_port", stopped)
    bench.drive.receive = lambda frame, now_s: pytest.fail("it went on")
    with pytest.raises(Aborted, match="Stopped by Ctrl-C"), bench.opened():
        pass


def test_a_gyro_that_vanishes_while_it_is_contacted_is_told_once(bench, monkeypatch):
    class Killed(GyroPort):
        def read(self):
            self.vanished = self.vanished or self.time.now_s > self.begin_s + 0.5
            return super().read()

    monkeypatch.setattr(drivers.bench.devices, "open_port", lambda path, baud: Killed(bench.time))
    with pytest.raises(DeviceFault) as caught, bench.opened():
        pass
    assert str(caught.value).count("wire has vanished") == 1


def test_torque_is_refused_before_arming_and_off_is_safe_at_any_time(bench):
    bench.torque_off()
    bench.disarm()
    bench.close()
    with pytest.raises(DeviceFault, match="not armed"):
        bench.exchange(0.0, 1.0)
    with pytest.raises(DeviceFault, match="before it is open"):
        bench.arm()


def test_report_tells_of_both_devices(bench):
    with bench.opened(), bench.armed():
        play(bench, 50)
        report = bench.report()
    assert report.gyro.lost == 0
    assert report.gyro.rate_hz == pytest.approx(2000, rel=0.05)
    assert "watchdog of 100 ms set in the drive and read back" in report.amplifier_notes
    assert "ordinary scheduling" in report.real_time


def test_a_bench_that_was_never_opened_has_nothing_to_better(bench):
    assert bench.corrections() == ()


def test_torque_that_is_recorded_as_it_was_sent_needs_no_drives_clock(bench):
    bench.amplifier.config = bench._retiming._config = CONFIG.amplifier.model_copy(update={"torque_source": "sent"})
    with bench.opened(), bench.armed():
        bench.begin_set(lambda t: 0.0, 3.0)
        for _ in range(6000):
            bench.time.now_s += 1e-3
            bench.exchange(bench.clock.now_s(), 0.0)
        bench.end_set()
    (one,) = bench.corrections()
    assert len(one.samples[0]) > 10
    assert one.torque == ((), ())
