from drivers import discovery
from drivers.discovery import SerialDevice


def test_machine_is_searched_without_opening_or_failing():
    assert all(str(device) for device in discovery.serial_devices())
    assert all(adapter.interface != "virtual" for adapter in discovery.can_adapters())


def test_slow_latency_timer_is_pointed_out():
    assert "16 ms: bytes arrive in bunches" in str(SerialDevice("/dev/ttyUSB0", "FT232R", 16))
    assert "latency" not in str(SerialDevice("/dev/ttyUSB0", "FT232R", 1))
