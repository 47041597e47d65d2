"""A gyro whose sign turns in the middle of a set is found out by the platform that the torque would then be turning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest

from rig.errors import SafetyTrip
from rig.platform import Platform
from tests.rig.guard.test_motion import DECLARED, RUBBING, USUAL, campaign, played, when

SETTLE_S = 0.5  # of zero torque before the set
LIMITS = {"torque_nm": 150}
LITTLE = [{"torque_nm": 30, "frequency_hz": 3, "duration_s": 3}]  # travels 2.7 deg, 8 deg at most if turned
Truth = Mapping[str, object]
STICKY = USUAL | {"effects": {"coulomb_friction": {"level_nm": 8.0}}}


def seen_after_s(
    truth: Truth, sets: Sequence[Mapping[str, float]], moment_s: float, declared: Platform = DECLARED
) -> float:
    """How long after the moment, in seconds of the set, the guard trips."""

    def turned(time_s: float, rate_rad_s: float) -> float:
        return -rate_rad_s if time_s - SETTLE_S > moment_s else rate_rad_s

    cause = played(campaign(truth, sets, limits=LIMITS), declared, turned)
    assert isinstance(cause, SafetyTrip), cause
    return when(str(cause)) - moment_s


@pytest.mark.parametrize("truth", [USUAL, RUBBING, STICKY], ids=["smooth", "rubbing", "sticky"])
@pytest.mark.parametrize("phase", [0.0, 0.15, 0.3, 0.5])
def test_a_sign_that_turns_is_seen_within_a_second_at_whatever_phase(truth: Truth, phase: float) -> None:
    assert seen_after_s(truth, LITTLE, 1.0 + phase / 3.0) < 1.0


@pytest.mark.parametrize("declared", [Platform(0.04, 0.06, 340.0), Platform(0.01, 0.06, 1360.0)], ids=["soft", "stiff"])
def test_the_declared_model_may_be_wrong_by_two(declared: Platform) -> None:
    assert seen_after_s(USUAL, LITTLE, 1.1, declared) < 1.0


def test_a_slow_set_takes_little_longer() -> None:
    slow = [{"torque_nm": 30, "frequency_hz": 0.5, "duration_s": 4}]
    assert seen_after_s(RUBBING, slow, 1.7) < 1.5


def test_a_sign_that_turns_in_the_first_moments_of_a_set_is_seen_too() -> None:
    assert seen_after_s(USUAL, LITTLE, 0.03) < 1.0


@pytest.mark.parametrize("hz", [6.0, 9.0, 14.0])
def test_a_set_whose_sign_stays_plays_to_its_end(hz: float) -> None:
    plain = [{"torque_nm": 20, "frequency_hz": hz, "duration_s": 1.5}]
    late = USUAL | {"effects": {"torque_delay": {"delay_s": 0.004}, "coulomb_friction": {"level_nm": 6.0}}}
    assert played(campaign(late, plain, limits=LIMITS)) is None
