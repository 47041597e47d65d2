"""Commands run in this process, on a rig that a test scripts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner, Result

from commands.campaign import backends, playing
from commands.campaign.backends import Stage
from rig.clock import VirtualClock
from rig.config.load import LoadedConfig
from rig.interface import Rig

TWO_SETS = """
backend: simulated
simulated: {}
limits: {frozen_gyro_ms: null}
excitation:
  rest_s: 0.2
  sets:
    - {torque_nm: 20, frequency_hz: 5, duration_s: 0.4}
    - {torque_nm: 20, frequency_hz: 7, duration_s: 0.4}
"""
SECOND_SET_S = 0.5 + 0.4 + 0.05 + 0.2 + 0.1  # well inside the second set, on the sequencer's clock


def write_config(folder: Path, text: str = TWO_SETS) -> Path:
    path = folder / "two.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def command(app: typer.Typer, *arguments: object) -> Result:
    """Run a command line; stdout and stderr come apart."""
    return CliRunner().invoke(app, [str(a) for a in arguments])


def put_on_stage(monkeypatch: pytest.MonkeyPatch, rig: Rig, name: str = "simulated") -> None:
    """Let ``rig`` stand in for the backend of that name."""

    @contextmanager
    def scripted(loaded: LoadedConfig, raw_folder: Path) -> Iterator[Stage]:
        yield Stage(rig, VirtualClock())

    monkeypatch.setattr(backends, "BACKENDS", {**backends.BACKENDS, name: scripted})
    monkeypatch.setattr(playing, "BACKENDS", {**backends.BACKENDS, name: scripted})
