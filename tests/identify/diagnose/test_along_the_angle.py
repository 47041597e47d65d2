"""An inertia, a damping or a friction that changes with the angle shows, though neither angle nor motion alone does."""

from __future__ import annotations

import numpy as np
import pytest

from identify.conclude.headline import headline
from identify.conclude.next_steps import next_steps
from identify.pipeline import identify
from identify.results import Identification
from rig.arrays import Array
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording, Run

JC = (0.05, 0.2)


def turned(seed: int, inertia_share: float, damping_share: float, drift: float = 0.0) -> Run:
    """A motion over most of a turn, and the torque that it takes where J and C change with the angle, or C in a run."""
    time = np.arange(3501) * 2e-3
    rng = np.random.default_rng(seed)
    swings = [(0.6 / hz, hz, rng.uniform(0.0, 2.0 * np.pi)) for hz in (0.31, 0.57, 1.03, 1.71, 2.9)]
    angle, rate, acceleration = (np.sum([part(*s, time) for s in swings], axis=0) for part in (_angle, _rate, _turn))
    inertia = JC[0] * (1.0 + inertia_share * np.sin(2.0 * angle))
    slope = JC[0] * inertia_share * 2.0 * np.cos(2.0 * angle)
    torque = inertia * acceleration + 0.5 * slope * rate**2 + JC[1] * (1.0 + damping_share * np.sin(2 * angle)) * rate
    torque = torque + JC[1] * drift * (time / time[-1] - 0.5) * rate
    torque = torque + 2e-3 * np.std(torque) * rng.standard_normal(len(time))
    return Run(
        f"run {seed}", time, np.ones(len(time), bool), rate_rad_s=rate + 4e-3 * rng.standard_normal(len(time)),
        angle_rad=angle + 2e-5 * rng.standard_normal(len(time)), torque_time_s=time, torque_nm=torque,
    )  # fmt: skip


def _angle(size: float, hz: float, phase: float, time: Array) -> Array:
    return size * np.sin(2.0 * np.pi * hz * time + phase)


def _rate(size: float, hz: float, phase: float, time: Array) -> Array:
    return size * 2.0 * np.pi * hz * np.cos(2.0 * np.pi * hz * time + phase)


def _turn(size: float, hz: float, phase: float, time: Array) -> Array:
    return -size * (2.0 * np.pi * hz) ** 2 * np.sin(2.0 * np.pi * hz * time + phase)


def identified(inertia_share: float, damping_share: float, drift: float = 0.0) -> Identification:
    runs = tuple(turned(seed, inertia_share, damping_share, drift) for seed in range(3))
    declared = Platform(0.045, 0.25, 0.0, terms=("inertia", "damping"))
    return identify(Recording(runs), declared, IdentifyConfig(candidates=("coulomb_friction",)))


@pytest.mark.slow
@pytest.mark.parametrize(("inertia_share", "damping_share", "what"), [(0.15, 0.0, "inertia"), (0.0, 0.5, "damping")])
def test_a_platform_that_changes_along_the_angle_is_not_accepted_and_what_changes_is_told(
    inertia_share: float, damping_share: float, what: str
) -> None:
    found = identified(inertia_share, damping_share)
    assert found.disturbance is not None
    assert [(d.on, d.changes) for d in found.disturbance.depends_on] == [("angle", what)]
    assert not found.accepted
    assert found.verdict.unexplained
    assert f"depends on the angle (as if the {what} changed with it)" in " ".join(found.verdict.sentences)
    assert headline(found)[0] == f"The declared model takes the {what} for constant, and it changes with the angle."
    assert any(f"The {what} changes with the angle" in step for step in next_steps(found))


@pytest.mark.slow
def test_one_that_does_not_change_is_accepted() -> None:
    found = identified(0.0, 0.0)
    assert found.accepted, found.reasons
    assert found.final.parameters["inertia"].value == pytest.approx(JC[0], rel=5e-3)


@pytest.mark.slow
def test_a_damping_that_falls_in_every_run_is_told_as_such() -> None:
    found = identified(0.0, 0.0, -0.4)
    assert found.disturbance is not None
    assert [(d.on, d.changes) for d in found.disturbance.depends_on] == [("time", "damping")]
    assert "depends on the time (as if the damping changed with it)" in " ".join(found.verdict.sentences)
