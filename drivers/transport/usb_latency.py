"""How long a USB serial adapter holds bytes back before it sends them: the latency timer of FTDI chips (Linux)."""

from __future__ import annotations

from pathlib import Path

USB_SERIAL = Path("/sys/bus/usb-serial/devices")
LOWEST_LATENCY_MS = 1  # ms, the least that an FTDI latency timer can be set to


def usb_latency_ms(port: str, root: Path = USB_SERIAL) -> int | None:
    """The timer of a port ("/dev/ttyUSB0", or a link to it) in ms; None where there is none or nobody may know."""
    try:
        return int((root / Path(port).resolve().name / "latency_timer").read_text("ascii"))
    except (OSError, ValueError):
        return None


def describe_usb_latency(port: str, root: Path = USB_SERIAL) -> str:
    """What there is to say about it; empty where there is no timer."""
    held_ms = usb_latency_ms(port, root)
    if held_ms is None:
        return ""
    slow = (
        ": bytes arrive in bunches; the driver asks for 1 ms when it opens the port"
        if held_ms > LOWEST_LATENCY_MS
        else ""
    )
    return f"latency timer {held_ms} ms{slow}"
