"""The latency timer of a serial adapter is read where there is one, and a slow one pointed out."""

from pathlib import Path

import pytest

from drivers.transport.usb_latency import describe_usb_latency, usb_latency_ms


def adapter(root: Path, timer: str) -> Path:
    (root / "ttyUSB7").mkdir()
    (root / "ttyUSB7" / "latency_timer").write_text(timer)
    return root


@pytest.mark.parametrize(("timer", "says"), [("16\n", "latency timer 16 ms: bytes arrive in bunches"), ("1\n", "1 ms")])
def test_the_timer_is_told_with_what_it_means(tmp_path, timer, says):
    told = describe_usb_latency("/dev/ttyUSB7", adapter(tmp_path, timer))
    assert says in told
    assert ("bunches" in told) == (timer == "16\n")


def test_a_port_is_followed_by_its_stable_name(tmp_path):
    link = tmp_path / "by-id"
    link.symlink_to("/dev/ttyUSB7")
    assert usb_latency_ms(str(link), adapter(tmp_path, "16")) == 16


@pytest.mark.parametrize("port", ["/dev/ttyACM0", "COM3"])
def test_a_port_without_a_timer_says_nothing(tmp_path, port):
    assert describe_usb_latency(port, tmp_path) == ""


def test_a_timer_that_is_no_number_says_nothing(tmp_path):
    assert describe_usb_latency("/dev/ttyUSB7", adapter(tmp_path, "soon")) == ""
