"""`rig check` says everything that is wrong at once, with its cure, and moves nothing."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from commands.rig.app import app
from tests.commands.support import TWO_SETS, command, write_config

ROOT = Path(__file__).parents[3]
PAPER_SETS = ("0.5 Hz: 300.0 N m", "1 Hz: 300.0 N m", "3 Hz: 250.0 N m", "6 Hz: 200.0 N m", "9 Hz: 150.0 N m")


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_sound_campaign_passes_and_leaves_nothing_behind(tmp_path: Path) -> None:
    done = command(app, "check", ROOT / "rig.yaml")
    assert done.exit_code == 0, done.output
    assert "configuration" in done.stdout and done.stdout.count("forecast") == 5
    assert done.stdout.count("times excitation.margin") == 2  # travel and rate, said once for all sets
    assert "All checks passed; nothing was moved." in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_the_torques_of_the_paper_within_ten_degrees_are_refused_set_by_set_with_what_passes() -> None:
    done = command(app, "check", ROOT / "rig.yaml", "--set", "excitation.scale_to_limits=false")
    assert done.exit_code == 2
    lines = done.stderr.splitlines()
    for name in PAPER_SETS:
        (line,) = [line for line in lines if name in line]
        assert "would move the platform" in line and "deg" in line and "N m is allowed" in line


def test_what_passes_by_its_word_does_pass(tmp_path: Path) -> None:
    text = TWO_SETS + "    - {torque_nm: 300, frequency_hz: 0.5, duration_s: 2}\n"
    refused = command(app, "check", write_config(tmp_path, text))
    (line,) = [line for line in refused.stderr.splitlines() if "0.5 Hz" in line]
    torque = line.split("At most ")[1].split(" N m is allowed")[0]
    config = write_config(tmp_path, text.replace("torque_nm: 300", f"torque_nm: {torque}"))
    assert command(app, "check", config).exit_code == 0


def test_a_forecast_for_a_platform_of_unit_inertia_says_so(tmp_path: Path) -> None:
    model = "model: {inertia_kg_m2: 1.0, stiffness_nm_rad: 300.0, inertia_unknown: true}\n"
    lines = command(app, "check", write_config(tmp_path, TWO_SETS + model)).stdout.splitlines()
    told = next(i for i, line in enumerate(lines) if "unit inertia (model.inertia_unknown)" in line)
    assert told < next(i for i, line in enumerate(lines) if "would move the platform" in line)


def test_a_wrong_file_is_refused_with_its_line(tmp_path: Path) -> None:
    done = command(app, "check", write_config(tmp_path, TWO_SETS.replace("rest_s", "rest_ms")))
    assert done.exit_code == 2
    assert "two.yaml:6" in done.stderr and "did you mean 'rest_s'" in done.stderr


def test_code_that_a_file_brings_is_announced_before_it_runs(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("raise ValueError('it ran')")
    text = TWO_SETS + "model: {effects_from: mine.py}\n"
    done = command(app, "check", write_config(tmp_path, text))
    assert done.exit_code == 2
    notice, refusal = done.stderr.splitlines()
    assert notice == f"runs code: {tmp_path / 'mine.py'} (named by model.effects_from)"
    assert "it ran" in refusal


def test_recordings_are_read_and_described(tmp_path: Path) -> None:
    rows = "\n".join(f"{i / 100},{i % 7 - 3},{(i % 5) / 10}" for i in range(400))
    (tmp_path / "a.csv").write_text(f"time_s,torque_nm,rate_rad_s\n{rows}\n")
    config = write_config(tmp_path, "backend: recorded\nrecorded: {runs: [{file: a.csv}]}\n")
    done = command(app, "check", config)
    assert done.exit_code == 0, done.output
    assert "recording a.csv: 400 samples of rate over 3.99 s, 0 invalid, with torque, use: auto" in done.stdout


def test_devices_that_do_not_answer_are_listed_together_after_the_forecast() -> None:
    missing = ("--set", "bench.gyroscope.port=/dev/no_gyro", "--set", "bench.amplifier.can.channel=/dev/no_adapter")
    done = command(app, "check", ROOT / "examples" / "bench.yaml", *missing)
    assert done.exit_code == 3
    assert done.stdout.count("forecast") == 5
    assert "/dev/no_gyro" in done.stderr and "/dev/no_adapter" in done.stderr


def test_it_says_which_set_alone_cannot_tell_inertia_from_stiffness_and_how_to_mend_it(tmp_path: Path) -> None:
    text = """
backend: simulated
simulated: {}
limits: {frozen_gyro_ms: null}
excitation:
  sets: [{torque_nm: 60, frequency_hz: 0.5, soft_start_s: 1.5, duration_s: 4}]
"""
    done = command(app, "check", write_config(tmp_path, text))
    assert done.exit_code == 0, done.output
    assert "0.5 Hz soft alone cannot separate inertia from stiffness: keep the start transient" in done.stdout
    assert "NOT determined" in done.stdout


def test_a_free_decay_without_torque_promises_ratios_only(tmp_path: Path) -> None:
    time_s = [i / 200 for i in range(1000)]
    ring = [math.exp(-1.125 * t) * math.cos(184.0 * t) for t in time_s]
    rows = "\n".join(f"{t},{0.1 * x}" for t, x in zip(time_s, ring, strict=True))
    (tmp_path / "decay.csv").write_text(f"time_s,angle_rad\n{rows}\n")
    done = command(app, "check", write_config(tmp_path, "backend: recorded\nrecorded: {runs: [{file: decay.csv}]}\n"))
    assert done.exit_code == 0, done.output
    assert "a decay without torque determines only ratios; expected C/J" in done.stdout
