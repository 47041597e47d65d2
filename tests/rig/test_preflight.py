"""The forecast of travel, rate and torque, held against figures worked out by hand and from the paper."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest

from rig.arrays import Array
from rig.config.excitation import PAPER_SETS, ExcitationConfig
from rig.config.limits import LimitsConfig
from rig.dynamics import Grid
from rig.errors import PreflightRefusal
from rig.excitation import PlannedSet, Sine, planned
from rig.platform import Platform
from rig.preflight import limits_broken, model_hint, peaks, plan, predict_all, simulated_sets

PAPER = Platform()
WIDE = LimitsConfig(travel_deg=10, rate_deg_s=4000, torque_nm=350)
# Largest torque within 10 deg, start transient included; travel of the published sets in steady state.
WITH_TRANSIENT_NM = (117.1, 115.6, 108.7, 102.5, 82.8)
STEADY_DEG = (25.4, 25.4, 21.4, 17.7, 14.0)


def steady_travel_deg(torque_nm: float, hz: float) -> float:
    w = 2 * math.pi * hz
    stiff = complex(PAPER.stiffness_nm_rad - PAPER.inertia_kg_m2 * w * w, PAPER.damping_nm_s_rad * w)
    return math.degrees(torque_nm / abs(stiff))


def test_the_published_torques_break_the_published_travel_and_these_would_not() -> None:
    found = predict_all(PAPER, ExcitationConfig(), WIDE)
    assert [p.largest_torque_nm for p in found] == pytest.approx(WITH_TRANSIENT_NM, abs=0.06)
    assert not any(p.passes for p in found)


def test_the_transient_adds_up_to_three_degrees_to_the_steady_travel_of_sets_that_would_fit() -> None:
    steady = [steady_travel_deg(a, f) for a, f in PAPER_SETS]
    assert steady == pytest.approx(STEADY_DEG, abs=0.06)
    fits = [10.0 * a / s for (a, _), s in zip(PAPER_SETS, steady, strict=True)]
    added = [
        peaks(PAPER, PlannedSet("", Sine(torque_nm=a, frequency_hz=f))).travel_deg - 10.0
        for a, (_, f) in zip(fits, PAPER_SETS, strict=True)
    ]
    assert all(x > 0 for x in added)
    assert 2.5 < max(added) < 3.1


def test_a_soft_start_leaves_the_steady_travel() -> None:
    soft = PlannedSet("", Sine(torque_nm=100, frequency_hz=9, soft_start_s=3))
    assert peaks(PAPER, soft).travel_deg == pytest.approx(steady_travel_deg(100, 9), rel=2e-3)


def test_the_gyros_full_scale_is_a_limit_too() -> None:
    allowed = predict_all(PAPER, ExcitationConfig(), WIDE, rate_full_scale_rad_s=math.radians(400))
    assert [p.largest_torque_nm for p in allowed[3:]] == pytest.approx([67.1, 42.0], abs=0.1)


def test_a_refusal_for_the_gyros_full_scale_says_that_it_is_the_gyros() -> None:
    with pytest.raises(PreflightRefusal) as refused:
        plan(PAPER, ExcitationConfig(), WIDE, math.radians(100), "simulated.gyro.full_scale_deg_s")
    assert "rate 100 deg/s (simulated.gyro.full_scale_deg_s, full scale of the gyro)" in str(refused.value)
    assert refused.value.keys == ("limits.travel_deg", "simulated.gyro.full_scale_deg_s")


def test_a_refusal_lists_every_set_with_its_travel_and_the_torque_that_passes() -> None:
    with pytest.raises(PreflightRefusal) as refused:
        plan(PAPER, ExcitationConfig(), LimitsConfig())
    text = str(refused.value)
    assert text.startswith("5 of 5 sets would break a limit; nothing was moved.")
    for line in (
        "0.5 Hz: 300.0 N m would move the platform by 25.63 deg",
        "9 Hz: 150.0 N m would move the platform by 18.11 deg",
    ):
        assert line in text
    for passes in ("117.0", "115.6", "108.6", "67.1", "42.0"):
        assert passes in text
    assert "scale_to_limits: true" in text


def test_the_limit_that_is_said_has_the_number_of_the_file_and_its_margin_by_name() -> None:
    scaled = ExcitationConfig(scale_to_limits=True, margin=0.95)
    predictions = predict_all(PAPER, scaled, LimitsConfig(travel_deg=10))
    assert "This exceeds the travel limit of 9.5 deg" in predictions[0].describe_as_played()
    text = limits_broken(predictions)
    assert text.count("travel 9.5 deg (10 by limits.travel_deg, times excitation.margin 0.95)") == 1
    unscaled = limits_broken(predict_all(PAPER, ExcitationConfig(), LimitsConfig(travel_deg=10)))
    assert "travel 10 deg (limits.travel_deg)" in unscaled


def test_a_travel_cap_of_a_set_is_said_to_be_the_sets() -> None:
    sets = [{"torque_nm": 50, "frequency_hz": 1, "travel_cap_deg": 2}]
    capped = ExcitationConfig.model_validate({"sets": sets, "scale_to_limits": True})
    predictions = predict_all(PAPER, capped, WIDE)
    assert "limit of 2 deg (travel_cap_deg of the set)" in predictions[0].describe_as_played()
    assert limits_broken(predictions) == ""


def test_what_is_said_to_pass_does_pass() -> None:
    sentences = [p.describe() for p in predict_all(PAPER, ExcitationConfig(), LimitsConfig())]
    said = [float(re.search(r"At most ([0-9.]+) N m is allowed$", text)[1]) for text in sentences]  # type: ignore[index]
    sets = [{"torque_nm": a, "frequency_hz": f} for a, (_, f) in zip(said, PAPER_SETS, strict=True)]
    assert len(plan(PAPER, ExcitationConfig.model_validate({"sets": sets}), LimitsConfig())) == 5


def test_scaled_sets_reach_the_margin_and_no_further() -> None:
    sets = plan(PAPER, ExcitationConfig(scale_to_limits=True, margin=0.95), LimitsConfig())
    found = [peaks(PAPER, s) for s in sets]
    assert [p.travel_deg for p in found[:3]] == pytest.approx([9.5] * 3, rel=1e-6)
    assert [p.rate_deg_s for p in found[3:]] == pytest.approx([380.0] * 2, rel=1e-6)


def test_a_set_that_fits_is_never_scaled_up() -> None:
    quiet = ExcitationConfig.model_validate({"scale_to_limits": True, "sets": [{"torque_nm": 10, "frequency_hz": 1}]})
    assert plan(PAPER, quiet, LimitsConfig())[0].scale == 1.0


def test_a_travel_cap_scales_its_set_alone() -> None:
    sets = [
        {"kind": "multisine", "torque_nm": 80, "from_hz": 0.5, "to_hz": 40, "travel_cap_deg": 2},
        {"torque_nm": 50, "frequency_hz": 1},
    ]
    capped, plain = plan(PAPER, ExcitationConfig.model_validate({"sets": sets}), LimitsConfig())
    assert peaks(PAPER, capped).travel_deg == pytest.approx(2.0, rel=1e-6)
    assert plain.scale == 1.0


def test_with_declared_friction_the_largest_torque_is_found_by_bisection() -> None:
    rough = Platform(effects={"coulomb_friction": {"level": 2.0}})
    one = ExcitationConfig.model_validate({"sets": [{"torque_nm": 300, "frequency_hz": 3, "duration_s": 2}]})
    found = predict_all(rough, one, WIDE)[0]
    assert found.scale > predict_all(PAPER, one, WIDE)[0].scale
    at_that_scale = peaks(rough, found.planned, found.scale)
    assert at_that_scale.travel_deg == pytest.approx(10.0, abs=1e-3)
    assert at_that_scale.travel_deg <= 10.0


LOOSE = Platform(0.5, 0.0, 0.0, terms=("inertia",))
# A sine from rest leaves A T^2 n / (2 pi J) behind: n = 3 periods T of 1 s.
STEP_NM = 0.5 * 2 * math.pi * math.radians(4.0) / 3.0


def walking(count: int, **more: object) -> ExcitationConfig:
    sets = [{"torque_nm": STEP_NM, "frequency_hz": 1, "duration_s": 3}] * count
    return ExcitationConfig.model_validate({"sets": sets, "rest_s": 2, **more})


def test_what_sets_leave_behind_where_no_spring_pulls_back_adds_up() -> None:
    found = predict_all(LOOSE, walking(4), WIDE)
    assert [p.peaks.travel_deg for p in found] == pytest.approx([4, 8, 12, 16], rel=1e-3)
    assert [p.starts_deg for p in found] == pytest.approx([0, 4, 8, 12], abs=0.01)
    assert not any(p.passes for p in found)
    assert all(p.passes for p in predict_all(LOOSE, walking(2), WIDE))


@pytest.mark.parametrize("effects", [{}, {"coulomb_friction": {"level": 0.002}}])
def test_the_torques_said_to_pass_pass_together(effects: dict[str, dict[str, float]]) -> None:
    loose = Platform(0.5, 0.0, 0.0, effects, ("inertia",))
    sentences = [p.describe() for p in predict_all(loose, walking(4), WIDE)]
    assert "not after the sets before it" in sentences[0]
    assert "from the start of the campaign. This exceeds the travel limit" in sentences[3]
    said = [float(re.search(r"At most ([0-9.]+) N m is allowed$", text)[1]) for text in sentences]  # type: ignore[index]
    sets = [{"torque_nm": a, "frequency_hz": 1, "duration_s": 3} for a in said]
    played = plan(loose, ExcitationConfig.model_validate({"sets": sets, "rest_s": 2}), WIDE)
    assert [p.scale for p in played] == [1.0] * 4


def test_sets_that_walk_are_scaled_alike_until_all_of_them_fit() -> None:
    sets = plan(LOOSE, walking(5, scale_to_limits=True, margin=0.9), WIDE)
    assert [s.scale for s in sets] == pytest.approx([9.0 / 20.0] * 5, rel=1e-3)


def test_a_spring_that_pulls_back_within_the_rest_leaves_nothing_behind() -> None:
    assert {p.starts_deg for p in predict_all(PAPER, ExcitationConfig(), WIDE)} == {0.0}


@pytest.mark.parametrize(
    ("platform", "said"),
    [
        (Platform(stiffness_nm_rad=0.0), "no stiffness"),
        (Platform(damping_nm_s_rad=-0.5), "unstable"),
        (Platform(stiffness_nm_rad=-5.0), "unstable"),
    ],
)
def test_a_model_that_drifts_or_runs_away_is_refused_with_the_reason(platform: Platform, said: str) -> None:
    with pytest.raises(PreflightRefusal) as refused:
        plan(platform, ExcitationConfig(), LimitsConfig())
    assert said in str(refused.value)
    assert said in model_hint(platform)


@pytest.mark.parametrize(
    ("stiffness_nm_rad", "sine_hz", "thinned"),
    [(40.0, 0.05, True), (40.0, 50.0, False), (2.0e6, 0.05, False)],
)  # fmt: skip
def test_a_set_of_many_minutes_is_thinned_where_torque_and_platform_are_slow(
    stiffness_nm_rad: float, sine_hz: float, thinned: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tenth of them here, and a tenth of the samples that are many."""
    monkeypatch.setattr(simulated_sets, "LONG_SAMPLES", simulated_sets.LONG_SAMPLES // 10)
    platform = Platform(inertia_kg_m2=60.0, damping_nm_s_rad=8.0, stiffness_nm_rad=stiffness_nm_rad)
    (long,) = planned([Sine(torque_nm=1.0, frequency_hz=sine_hz, duration_s=24.0)])
    kept: list[int] = []
    simulated = simulated_sets.Grid

    def grid(time_s: Array, *rest: Any) -> Grid:
        kept.append(len(time_s))
        return simulated(time_s, *rest)

    monkeypatch.setattr(simulated_sets, "Grid", grid)
    found = peaks(platform, long)
    monkeypatch.setattr(simulated_sets, "LONG_SAMPLES", 10**9)
    assert found == pytest.approx(peaks(platform, long), rel=1e-4)
    assert (kept[0] <= 40_000) is thinned
    assert kept[1] > 90_000
