"""What a driver refuses is told together with everything else that is wrong in the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from rig.cli.app import app
from rig.cli.device_settings import device_faults
from tests.rig.cli.support import command

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


def test_a_device_that_there_is_not_is_told_at_its_line(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text("backend: bench\nbench:\n  amplifier: {nod: 1}\n  gyroscope:\n    device: stim3000\n")
    done = command(app, "check", path)
    assert done.exit_code == 2
    assert "wrong.yaml:3: bench.amplifier.nod" in done.stderr
    assert "wrong.yaml:5: bench.gyroscope.device: no driver called 'stim3000'" in done.stderr


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
