"""Which of the ports of this machine is the gyroscope's and which the CAN adapter's, as far as that shows."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from commands.rig.devices import can_adapters, device_lines, serial_ports
from commands.rig.init_yaml import bench_yaml

Lister = Callable[[], list[Any]]
# What serial CAN adapters call themselves: USB ids of CANable and CANtact, and words of their description.
CAN_IDS = frozenset({(0x16D0, 0x117E), (0xAD50, 0x60C4), (0x1D50, 0x606F)})
CAN_WORDS = ("can", "lawicel")
NO_USB = ("ttyS", "ttyAMA", "COM1", "Bluetooth")  # built in, or no cable: not guessed


def bench_text(config: str, ports: Lister = serial_ports, adapters: Lister = can_adapters) -> tuple[str, list[str]]:
    """The rig.yaml of a bench, and what was found on this machine, one line each."""
    ports, adapters = cache(ports), cache(adapters)  # looking for adapters takes its time
    seen = device_lines(ports, adapters)
    found, buses = _listed(ports), _listed(adapters)
    serial_can = next((p for p in found if _is_can(p)), None)
    can = None
    if buses:
        can = {"interface": str(buses[0].get("interface")), "channel": str(buses[0].get("channel"))}
    elif serial_can is not None:
        can = {"interface": "slcan_bulk", "channel": str(serial_can.device)}
    others = [p for p in found if p is not serial_can and not any(word in str(p.device) for word in NO_USB)]
    gyro = str(others[0].device) if others else None
    return bench_yaml(gyro, can, seen, config), seen


def _listed(find: Lister) -> list[Any]:
    try:
        return find()
    except Exception:  # noqa: BLE001 (drivers of other makers raise what they like; the listing says it)
        return []


def _is_can(port: Any) -> bool:
    text = f"{port.description or ''} {getattr(port, 'product', '') or ''}".lower()
    return (port.vid, port.pid) in CAN_IDS or any(word in text.split() or word in text[:6] for word in CAN_WORDS)
