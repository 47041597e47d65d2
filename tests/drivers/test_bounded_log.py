from drivers.amplifiers.cia402_status import DriveStatus
from drivers.bounded_log import FirstAndLast
from drivers.codecs import vectornav
from drivers.codecs.lawicel import CanFrame
from drivers.gyroscopes import make_gyroscope
from drivers.transport.can_link import ReceivedFrame
from rig.config.bench import GyroscopeConfig


def test_the_first_and_the_last_stay_and_the_rest_is_counted():
    kept = FirstAndLast(3)
    for k in range(10):
        kept.append(k)
    assert kept == [0, 1, 2, 7, 8, 9]
    assert kept.left_out == 4
    assert kept.describe() == ("0", "1", "2", "... 4 more ...", "7", "8", "9")


def test_what_fits_is_told_as_it_is():
    kept = FirstAndLast(3)
    for k in range(6):
        kept.append(k)
    assert kept.describe(lambda k: f"<{k}>") == ("<0>", "<1>", "<2>", "<3>", "<4>", "<5>")


def test_a_gyro_that_complains_all_day_fills_no_memory():
    gyro = make_gyroscope(GyroscopeConfig(device="vectornav"))
    for k in range(2000):
        gyro.feed(vectornav.encode_line("ERR", "12"), float(k))
    assert len(gyro.messages) == 10
    assert gyro.messages.left_out == 1990


def test_a_drive_that_complains_all_day_fills_no_memory():
    status = DriveStatus(1, 0.1, "drive")
    for k in range(2000):
        status.receive(ReceivedFrame(float(k), CanFrame(0x81, bytes([0x10, 0x43, 0x01, 0, 0, 0, 0, 0]))))
    assert len(status.emergencies) == 100
    assert (status.emergencies[0][0], status.emergencies[-1][0]) == (0.0, 1999.0)
    assert "EMCY 0x4310" in status.new_emergency
