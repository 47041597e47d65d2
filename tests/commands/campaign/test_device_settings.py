"""What a driver refuses is told together with everything else that is wrong in the file."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from commands.campaign.backends import EMULATED
from commands.campaign.device_settings import device_faults
from commands.rig.app import app
from tests.commands.support import command

WRONG = """backend: bench
limits: {travl_deg: 3}
bench:
  settle: 3
  gyroscope:
    prt: /dev/x
    settings: {filtr_hz: 3, datagrm: 2}
  amplifier:
    device: odrive
    can: {interfce: x}
    settings: {rated_torque: 3}
"""


def test_unknown_keys_of_the_file_and_of_both_devices_are_told_at_once_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(WRONG)
    done = command(app, "check", path)
    assert done.exit_code == 2
    said = done.stderr.splitlines()
    keys = ("travl_deg", "settle", "prt", "filtr_hz", "datagrm", "interfce", "rated_torque")
    lines = (2, 4, 6, 7, 7, 10, 11)
    assert len(said) == len(keys)
    for key, line, text in zip(keys, lines, said, strict=True):
        assert f"wrong.yaml:{line}: " in text and key in text


def test_a_replay_named_by_what_is_no_name_of_a_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(f"backend: bench\nbench: {{replay: {'x' * 4000}}}\n")
    done = command(app, "check", path)
    assert done.exit_code == 2
    assert "there is no raw capture" in done.stderr and len(done.stderr) < 1000


def test_a_device_that_there_is_not_is_told_at_its_line(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text("backend: bench\nbench:\n  amplifier: {nod: 1}\n  gyroscope:\n    device: stim3000\n")
    done = command(app, "check", path)
    assert done.exit_code == 2
    assert "wrong.yaml:3: bench.amplifier.nod" in done.stderr
    assert "wrong.yaml:5: bench.gyroscope.device: no driver called 'stim3000'" in done.stderr


ALL_KINDS = """backend: bench
limits: {travel_deg: far}
bench:
  gyroscope:
    port: /dev/ttyX9
    baud: quick
    settings: {filtr_hz: 3}
  amplifier:
    settings: {rated_torque: 3}
    can:
      channel: /dev/ttyX9
      bitrate: 123456
      options: {listen: true}
"""


def test_values_keys_settings_bit_rate_and_ports_are_told_in_one_round(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(ALL_KINDS)
    done = command(app, "check", path)
    assert done.exit_code == 2
    expected = (
        (2, "limits.travel_deg: 'far' is not allowed"),
        (6, "bench.gyroscope.baud: 'quick' is not allowed"),
        (7, "bench.gyroscope.settings.filtr_hz: unknown key; did you mean filter_hz?"),
        (9, "bench.amplifier.settings.rated_torque: unknown key"),
        (11, "bench.amplifier.can.channel: /dev/ttyX9 is also the port of the gyroscope (bench.gyroscope.port"),
        (12, "bench.amplifier.can.bitrate: 123456 is not one of a Lawicel adapter's: 10000, 20000"),
        (13, "bench.amplifier.can.options.listen: unknown key; slcan_bulk knows listen_only"),
    )
    for (line, text), said in zip(expected, done.stderr.splitlines(), strict=True):
        assert f"wrong.yaml:{line}: {text}" in said


def test_a_default_in_the_place_of_a_refused_value_accuses_nobody() -> None:
    # The default of 2000 samples a second would not fit this line; the one that was meant may well.
    gyroscope = {"sample_rate_hz": "500 Hz", "baud": 115_200}
    assert list(device_faults({"backend": "bench", "bench": {"gyroscope": gyroscope}})) == []


def ports(gyro: object, channel: object, **more: object) -> dict[str, object]:
    return {
        "backend": "bench",
        "bench": {"gyroscope": {"port": gyro}, "amplifier": {"can": {"channel": channel}}, **more},
    }


@pytest.mark.skipif(sys.platform == "win32", reason="links there need rights of their own")
def test_a_link_to_the_port_of_the_other_device_is_the_same_port(tmp_path: Path) -> None:
    (tmp_path / "tty").touch()
    (tmp_path / "by-id").symlink_to(tmp_path / "tty")
    ((path, text),) = device_faults(ports(str(tmp_path / "by-id"), f"{tmp_path / 'tty'}@115200"), played_on="bench")
    assert path == ("bench", "amplifier", "can", "channel")
    assert "bench.gyroscope.port" in text


@pytest.mark.parametrize(("gyro", "channel"), [("/dev/ttyX8", "/dev/ttyX9"), ("/dev/ttyX9", "can0"), ("a\0", "b")])
def test_two_ports_are_no_fault(gyro: str, channel: str) -> None:
    assert list(device_faults(ports(gyro, channel), played_on="bench")) == []


def test_ports_that_nobody_opens_may_be_anything() -> None:
    same = ports("/dev/ttyX9", "/dev/ttyX9")
    assert list(device_faults(same, played_on=EMULATED)) == []
    assert list(device_faults(ports(None, None, replay="runs/earlier"), played_on="bench")) == []


URLS = (
    "spy:///dev/ttyX9?file={file}", "SPY://loop://?file={file}", "hwgrep://.*", "loop://", "socket://127.0.0.1:1",
    "rfc2217://127.0.0.1:1",
)  # fmt: skip


@pytest.mark.parametrize("url", URLS)
@pytest.mark.parametrize("interface", ["slcan", "robotell", "seeedstudio", "serial", "slcan_bulk", "socketcan"])
def test_a_can_channel_that_is_a_url_is_refused_at_its_key_and_touches_no_file(
    tmp_path: Path, interface: str, url: str
) -> None:
    precious = tmp_path / "precious.txt"
    precious.write_text("three years of work")
    channel = url.format(file=precious)
    path = tmp_path / "rig.yaml"
    path.write_text(
        f"backend: bench\nbench:\n  gyroscope: {{port: /dev/ttyX8}}\n  amplifier:\n    can:\n"
        f"      interface: {interface}\n      channel: '{channel}'\n"
    )
    done = command(app, "check", path)
    assert done.exit_code == 2
    assert "rig.yaml:7: bench.amplifier.can.channel: " in done.stderr and "is a URL" in done.stderr
    assert precious.read_text() == "three years of work"


@pytest.mark.parametrize("played_on", ["bench", EMULATED])
def test_a_gyroscopes_port_that_is_a_url_is_refused_at_its_key(played_on: str) -> None:
    told = dict(device_faults(ports("spy:///dev/ttyX9?file=notes.txt", "/dev/ttyX8"), played_on=played_on))
    assert list(told) == [("bench", "gyroscope", "port")]
    assert "only plain names and paths" in told["bench", "gyroscope", "port"]


def test_a_channel_that_an_interface_itself_calls_by_a_url_is_taken() -> None:
    own = {"interface": "etas", "channel": "ETAS://ETH/ES910:abcd/CAN:1", "bitrate": 500_000}
    data = {"backend": "bench", "bench": {"gyroscope": {"port": "/dev/ttyX8"}, "amplifier": {"can": own}}}
    assert list(device_faults(data, played_on="bench")) == []


def test_a_library_to_be_loaded_is_refused() -> None:
    bus = {"interface": "usb2can", "channel": "ED000100", "options": {"dll": "evil.dll"}}
    ((path, text),) = device_faults({"backend": "bench", "bench": {"amplifier": {"can": bus}}})
    assert path == ("bench", "amplifier", "can", "options", "dll")
    assert "would run the code" in text


def test_both_empty_ports_are_told_at_once() -> None:
    told = dict(device_faults({"backend": "bench", "bench": {}}, played_on="bench"))
    assert [".".join(map(str, path)) for path in told] == ["bench.gyroscope.port", "bench.amplifier.can.channel"]
    assert all("is empty: name the port" in text for text in told.values())


def test_a_misspelt_can_interface_is_told_with_the_one_that_may_be_meant() -> None:
    can = {"interface": "socketcam", "bitrate": 123_456}
    ((path, text),) = device_faults({"backend": "bench", "bench": {"amplifier": {"can": can}}})
    assert path == ("bench", "amplifier", "can", "interface")
    assert text == "python-can has no interface 'socketcam'; did you mean socketcan?"


def test_misspelt_injected_faults_are_told_all_at_once_with_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "faults.yaml"
    path.write_text(
        "backend: bench\nbench:\n  emulator:\n    faults:\n      - {fault: gyro_silnt}\n      - {fault: gyro_silent}\n"
        "      - {fault: nothing_like_it}\n"
    )
    done = command(app, "check", path, "--emulate")
    assert done.exit_code == 2
    first, second = done.stderr.splitlines()
    assert "faults.yaml:5: bench.emulator.faults.0.fault: there is no fault 'gyro_silnt'; did you mean" in first
    assert "faults.yaml:7: bench.emulator.faults.2.fault: there is no fault 'nothing_like_it'; there are" in second


@pytest.mark.parametrize("backend", ["bench", "simulated"])
def test_a_device_without_an_emulator_is_told_only_where_it_is_emulated(backend: str) -> None:
    amplifier = {"device": "moteus", "can": {"interface": "socketcan"}}
    moteus = {"backend": backend, "bench": {"amplifier": amplifier}}
    ((path, text),) = device_faults(moteus, EMULATED)
    assert path == ("bench", "amplifier", "device")
    assert text == "'moteus' has no emulator: choose one of cia402, odrive"
    assert list(device_faults(moteus)) == []


@pytest.mark.parametrize(
    "data",
    [
        {"backend": "simulated", "bench": {"gyroscope": {"device": "none"}}},
        {"backend": "bench"},
        {"backend": "bench", "bench": 3},
        {"backend": "bench", "bench": {"gyroscope": [], "amplifier": None}},
        {"backend": "bench", "bench": {"gyroscope": {"settings": 3}, "amplifier": {"can": {"bitrate": "x"}}}},
    ],
)
def test_what_is_not_played_or_told_elsewhere_is_left_alone(data: dict[str, object]) -> None:
    assert list(device_faults(data)) == []
