"""What is plugged in: serial ports and CAN adapters of this machine, for `rig devices`."""

from __future__ import annotations

from dataclasses import dataclass

import can
from serial.tools import list_ports

FTDI_LATENCY = "/sys/bus/usb-serial/devices/{name}/latency_timer"
SLOW_LATENCY_MS = 1


@dataclass(frozen=True)
class SerialDevice:
    """A serial port. ``latency_ms`` is the FTDI latency timer, where there is one."""

    path: str
    description: str
    latency_ms: int | None = None

    def __str__(self) -> str:
        text = f"{self.path}  {self.description}"
        if self.latency_ms is not None and self.latency_ms > SLOW_LATENCY_MS:
            text += (
                f"  latency timer {self.latency_ms} ms: bytes arrive in bunches; the driver asks for 1 ms when it "
                "opens the port"
            )
        return text


@dataclass(frozen=True)
class CanAdapter:
    """A CAN adapter that python-can has found by itself."""

    interface: str
    channel: str

    def __str__(self) -> str:
        return f"{self.interface}  {self.channel}"


def serial_devices() -> list[SerialDevice]:
    """Serial ports, by path. A serial (slcan) CAN adapter is one of these."""
    return [
        SerialDevice(port.device, port.description or "", _latency_ms(port.name))
        for port in sorted(list_ports.comports(), key=lambda port: port.device)
    ]


def _latency_ms(name: str | None) -> int | None:
    try:
        with open(FTDI_LATENCY.format(name=name), encoding="ascii") as file:  # noqa: PTH123  a sysfs pattern
            return int(file.read())
    except (OSError, ValueError):
        return None


def can_adapters() -> list[CanAdapter]:
    """CAN adapters that can be listed without opening them; the test buses of python-can are left out."""
    found = []
    for config in can.detect_available_configs(interfaces=("socketcan", "pcan", "kvaser", "vector", "gs_usb", "ixxat")):
        found.append(CanAdapter(str(config["interface"]), str(config["channel"])))
    return sorted(found, key=str)
