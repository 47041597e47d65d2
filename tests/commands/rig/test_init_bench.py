"""`rig init` without a recording: a bench with what is plugged in, and everything unknown marked."""

from __future__ import annotations

from pathlib import Path

from commands.rig.app import app
from commands.rig.init_bench import bench_text
from rig.config.load import load_config
from tests.commands.support import command


class Port:
    def __init__(self, device: str, description: str, vid: int | None = None, pid: int | None = None) -> None:
        self.device, self.description, self.vid, self.pid, self.serial_number = device, description, vid, pid, None


def test_a_bench_is_written_with_what_is_there_and_the_rest_marked(tmp_path: Path) -> None:
    ports = [
        Port("/dev/ttyS0", "n/a"),
        Port("/dev/ttyACM0", "CANable 1.2", 0x16D0, 0x117E),
        Port("/dev/ttyUSB3", "FT232R"),
    ]
    text, seen = bench_text("rig.yaml", lambda: ports, list)
    assert any("ttyUSB3" in line for line in seen)
    (tmp_path / "rig.yaml").write_text(text, encoding="utf-8")
    bench = load_config(tmp_path / "rig.yaml").config.bench
    assert bench is not None
    assert (bench.gyroscope.port, bench.amplifier.can.channel) == ("/dev/ttyUSB3", "/dev/ttyACM0")
    assert bench.amplifier.can.interface == "slcan_bulk"
    assert "GUESS: the gyroscope's serial port" in text and "FILL IN: what your rig may do" in text


def test_a_bench_without_anything_is_written_too_and_says_what_to_fill_in(tmp_path: Path) -> None:
    def broken() -> list[object]:
        raise RuntimeError("no driver")

    text, seen = bench_text("rig.yaml", list, broken)
    assert any("no driver" in line for line in seen)
    assert "port: null  # FILL IN: the gyroscope's serial port" in text
    (tmp_path / "rig.yaml").write_text(text, encoding="utf-8")
    assert load_config(tmp_path / "rig.yaml").config.bench is not None
    adapter = {"interface": "socketcan", "channel": "can0"}
    assert 'interface: "socketcan"  # GUESS' in bench_text("rig.yaml", list, lambda: [adapter])[0]


def test_without_a_file_the_command_writes_a_bench_and_a_column_is_refused(tmp_path: Path) -> None:
    done = command(app, "init", "--out", tmp_path / "bench.yaml")
    assert done.exit_code == 0, done.stderr
    assert "Serial ports:" in done.stdout
    assert load_config(tmp_path / "bench.yaml").config.backend == "bench"
    done = command(app, "init", "--out", tmp_path / "two.yaml", "--rate", "w")
    assert done.exit_code == 2 and "was given without a recording" in done.stderr
