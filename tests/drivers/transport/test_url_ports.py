"""No port is opened by a URL, whoever asks: pyserial's handlers write files and reach other machines."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.transport.can_link import open_bus
from drivers.transport.socket_port import open_port
from rig.config.bench import CanConfig
from rig.errors import ConfigError


@pytest.mark.parametrize("interface", ["slcan", "robotell", "seeedstudio", "serial", "slcan_bulk"])
def test_a_bus_on_a_url_is_not_opened(tmp_path: Path, interface: str) -> None:
    kept = tmp_path / "kept.txt"
    kept.write_text("kept")
    config = CanConfig(interface=interface, channel=f"spy://loop://?file={kept}", bitrate=500_000)
    with pytest.raises(ConfigError, match=r"bench.amplifier.can.channel: .*is a URL"):
        open_bus(config)
    assert kept.read_text() == "kept"


def test_a_serial_port_on_a_url_is_not_opened() -> None:
    with pytest.raises(ConfigError, match="is a URL"):
        open_port("loop://", 115_200)


def test_a_long_url_is_cut_where_it_is_quoted() -> None:
    with pytest.raises(ConfigError) as caught:
        open_port("socket://" + "x" * 10_000, 115_200)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("interface", ["socketcand", "udp_multicast"])
def test_a_bus_that_reaches_other_machines_is_not_opened(interface: str) -> None:
    config = CanConfig(interface=interface, channel="239.74.163.2", bitrate=500_000)
    with pytest.raises(ConfigError, match=r"bench.amplifier.can.interface: .*reaches other machines"):
        open_bus(config)
