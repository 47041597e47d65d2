"""Short campaigns played on the simulated backend, one seed each, for the tests of many."""

from __future__ import annotations

from pathlib import Path

from commands.rig.app import app
from tests.commands.support import command

PLAYED = """
name: bench-a
backend: simulated
simulated: {platform: {effects: {coulomb_friction: {level_nm: 0.4}}}}
limits: {frozen_gyro_ms: null}
excitation:
  rest_s: 1.5
  sets:
    - {torque_nm: 20, frequency_hz: 5, duration_s: 0.6}
    - {torque_nm: 20, frequency_hz: 8, duration_s: 0.6}
identify: {candidates: [coulomb_friction], genetic: {population: 20, generations: 20}}
"""
FRICTION = "effects: {coulomb_friction: {level_nm: 0.4}}"


def recorded(file: object, effects_from: str = "") -> str:
    """A rig.yaml for one file of such a campaign; the friction is declared, so that nothing is left to look into."""
    own = f"effects_from: {effects_from}, " if effects_from else ""
    return (
        f"backend: recorded\nrecorded: {{runs: [{{file: {file}}}]}}\nmodel: {{{own}{FRICTION}}}\n"
        "identify: {candidates: [], genetic: {population: 20, generations: 20}}\n"
    )


def play(folder: Path, seed: int, text: str = PLAYED) -> Path:
    """Play one campaign into ``folder``; returns its recording.h5."""
    config = folder.with_name(f"{folder.name}.yaml")
    config.parent.mkdir(parents=True, exist_ok=True)
    config.write_text(text, encoding="utf-8")
    done = command(app, "play", config, "--out", folder, "--seed", seed, "--quiet")
    assert done.exit_code == 0, done.stderr
    config.unlink()
    return folder / "recording.h5"
