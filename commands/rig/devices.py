"""`rig devices`: serial ports and CAN adapters of this machine."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from commands.terminal.display import plain
from drivers.transport.usb_latency import describe_usb_latency

# Not asked for adapters: the first three python-can offers everywhere, with nothing plugged in; for servers elsewhere
# on the network (socketcand, which drivers.transport.can_link does not open) it listens for four seconds.
NO_ADAPTERS = ("virtual", "udp_multicast", "serial", "socketcand")
Lister = Callable[[], list[Any]]


def serial_ports() -> list[Any]:
    """The serial ports of this machine, as pyserial describes them."""
    from serial.tools import list_ports

    return sorted(list_ports.comports(), key=lambda port: str(port.device))


def can_adapters() -> list[Any]:
    """The CAN adapters that python-can finds: interface, channel, and more."""
    from drivers import can

    earlier = logging.root.manager.disable
    logging.disable(logging.CRITICAL)  # python-can reports every interface whose library is not installed
    try:
        return list(can.detect_available_configs([name for name in can.interfaces.BACKENDS if name not in NO_ADAPTERS]))
    finally:
        logging.disable(earlier)


def device_lines(ports: Lister = serial_ports, adapters: Lister = can_adapters) -> list[str]:
    """What is there, one line each; a listing that fails is said in its place and does not hide the other."""
    return [
        *_listing("Serial ports", ports, _serial_line, "None detected. Plug the gyro in, or check its driver."),
        *_listing(
            "CAN adapters",
            adapters,
            _can_line,
            "None detected. Serial (slcan) adapters are listed under serial ports.",
        ),
    ]


def _listing(title: str, find: Lister, line: Callable[[Any], str], none: str) -> list[str]:
    try:
        found = [plain(line(item)) for item in find()]
    except Exception as problem:  # noqa: BLE001 (drivers of other makers raise what they like)
        found = [plain(f"could not be listed: {type(problem).__name__}: {problem}")]
    return [f"{title}:", *(f"  {text}" for text in found or [none])]


def _serial_line(port: Any) -> str:
    ids = f", USB {port.vid:04x}:{port.pid:04x}" if port.vid is not None and port.pid is not None else ""
    number = f", serial number {port.serial_number}" if port.serial_number else ""
    latency = describe_usb_latency(str(port.device))
    return f"{port.device}  {port.description or 'no description'}{ids}{number}{', ' if latency else ''}{latency}"


def _can_line(adapter: Any) -> str:
    first = ("interface", "channel")
    rest = [f"{key} {value}" for key, value in adapter.items() if key not in first]
    return ", ".join([*(f"{key} {adapter.get(key)}" for key in first), *rest])
