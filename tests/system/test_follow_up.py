"""The loop closed twice: a campaign that cannot tell, the follow-up that can, and the twin of what came out."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.config.load import load_config
from rig.recording.hdf5 import read_recording_h5

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow

# Two slow sines that set in softly: no ring and no high frequency, so a lag of the drive is as good as a delay, and
# either is as good as damping.
CONFIG = """
backend: simulated
model: {inertia_kg_m2: 0.0185, damping_nm_s_rad: 0.06, stiffness_nm_rad: 650.0}
excitation:
  scale_to_limits: true
  sets:
    - {torque_nm: 100, frequency_hz: 1, duration_s: 6, soft_start_s: 1}
    - {torque_nm: 100, frequency_hz: 3, duration_s: 6, soft_start_s: 1}
simulated:
  platform:
    inertia_kg_m2: 0.0203
    damping_nm_s_rad: 0.0447
    stiffness_nm_rad: 681.2
    effects: {actuator_lag: {time_s: 0.002}}
identify:
  candidates: [torque_delay, actuator_lag, coulomb_friction]
"""
TRUTH = {"inertia": 0.0203, "damping": 0.0447, "stiffness": 681.2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("follow_up")
    (folder / "rig.yaml").write_text(CONFIG, encoding="utf-8")
    run(folder, "alone", "--set", "identify.follow_up=never")
    run(folder, "followed", "--set", "identify.follow_up=auto")
    return folder


def run(folder: Path, out: str, *more: str) -> None:
    command = [sys.executable, "-c", "from commands.identify_run import main; main()", "rig.yaml", "--out", out]
    done = subprocess.run(
        [*command, *more], cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    (folder / f"{out}.txt").write_text(done.stdout, encoding="utf-8")


def result(folder: Path, out: str) -> dict[str, Any]:
    return dict(json.loads((folder / out / "result.json").read_text(encoding="utf-8")))


def test_the_first_campaign_cannot_tell_and_says_what_would(folder: Path) -> None:
    found = result(folder, "alone")
    (name,) = found["verdict"]["effects"]
    assert found["verdict"]["confusable_with"][name]
    assert found["follow_up"]["planned"]["pairs"][0]["separation"] > 25.0
    assert (folder / "alone" / "follow_up.yaml").exists()


def test_after_the_follow_up_the_true_name_stands_alone_and_every_parameter_is_right(folder: Path) -> None:
    found = result(folder, "followed")
    assert found["verdict"]["effects"] == ["actuator_lag"]
    assert found["verdict"]["confusable_with"]["actuator_lag"] == []
    assert found["follow_up"]["played"] is True and len(found["follow_up"]["separated"]) == 1
    for name, value in TRUTH.items():
        assert found["after"]["parameters"][name]["value"] == pytest.approx(value, rel=0.01)
    lag = found["after"]["effect_parameters"]["actuator_lag"]["time"]
    assert lag["ci95"][0] - 2e-6 < 0.002 < lag["ci95"][1] + 2e-6


def test_one_table_has_the_error_before_after_and_after_the_follow_up(folder: Path) -> None:
    error = result(folder, "followed")["follow_up"]["error"]
    assert set(error) == {"before", "after", "after_follow_up"}
    without, after = (error[k]["holdout_rate_rms"] for k in ("after", "after_follow_up"))
    assert after < 0.5 * without
    assert after < 1.1 * result(folder, "followed")["noise_floor"]["holdout_rate_rms"]
    summary = (folder / "followed.txt").read_text(encoding="utf-8")
    assert "without follow-up" in summary and "after follow-up" in summary


def test_the_first_part_is_the_same_with_and_without_a_follow_up(folder: Path) -> None:
    alone, followed = (read_recording_h5(folder / out / "recording.h5").runs for out in ("alone", "followed"))
    assert len(followed) > len(alone)
    for one, other in zip(alone, followed, strict=False):
        assert one.rate_rad_s is not None and other.rate_rad_s is not None
        assert np.array_equal(one.rate_rad_s, other.rate_rad_s)


def test_the_model_is_the_declared_one_of_the_next_campaign_and_the_twin_of_the_rig(folder: Path) -> None:
    """What model.yaml says is what the simulated backend hides, and nothing is missing from it any more."""
    model = folder / "followed" / "model.yaml"
    loaded = load_config(folder / "rig.yaml", [f"model={model}", f"simulated.platform={model}"]).config
    assert loaded.model.platform() == loaded.simulated.platform.platform()
    assert loaded.model.platform().effects["actuator_lag"]["time"] == pytest.approx(0.002, rel=1e-3)
    again = f"excitation={folder / 'followed' / 'follow_up.yaml'}"
    run(folder, "twin", "--set", f"model={model}", "--set", f"simulated.platform={model}", "--set", again)
    twin = result(folder, "twin")
    assert twin["verdict"]["effects"] == [] and twin["verdict"]["unexplained"] is False
    assert twin["before"]["error"]["holdout_rate_rms"] < 1.1 * twin["noise_floor"]["holdout_rate_rms"]
    real = [r for r in read_recording_h5(folder / "followed" / "recording.h5").runs if r.name.startswith("follow-up")]
    replayed = read_recording_h5(folder / "twin" / "recording.h5").runs
    for one, other in zip(real, replayed, strict=True):
        assert one.rate_rad_s is not None and other.rate_rad_s is not None
        # Two gyros, each with noise of its own, and one motion.
        assert np.std(one.rate_rad_s - other.rate_rad_s) < 1.5 * twin["noise_floor"]["holdout_rate_rms"]
