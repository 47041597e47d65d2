"""`rig devices` lists what is there, and survives drivers that fail."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from commands.rig.devices import device_lines

PORT = SimpleNamespace(device="/dev/ttyUSB0", description="USB serial", vid=0x0403, pid=0x6001, serial_number="FT1")
ADAPTER = {"interface": "socketcan", "channel": "can0", "fd": True}


def failing() -> list[Any]:
    raise RuntimeError("library of the maker not found")


def test_each_port_and_adapter_has_a_line_with_what_identifies_it() -> None:
    lines = device_lines(lambda: [PORT], lambda: [ADAPTER])
    assert "  /dev/ttyUSB0  USB serial, USB 0403:6001, serial number FT1" in lines
    assert "  interface socketcan, channel can0, fd True" in lines


def test_nothing_found_is_said_with_what_to_do() -> None:
    assert sum("None detected" in line for line in device_lines(list, list)) == 2


def test_a_listing_that_fails_does_not_hide_the_other() -> None:
    lines = device_lines(lambda: [PORT], failing)
    assert any("/dev/ttyUSB0" in line for line in lines)
    assert any("library of the maker not found" in line for line in lines)


def test_the_ports_of_this_machine_can_be_listed() -> None:
    assert device_lines()[0] == "Serial ports:"
