"""What a residual holds is said in the words of its cause, and of noise nothing is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.diagnose.diagnosis import Sensor, diagnose
from identify.diagnose.wording import WORTH_OF_PAST, diagnosis_sentences, is_significant
from identify.results import RunTraces, Share
from rig.platform import Platform
from tests.identify.leftover import diagnosed, diagnosis_of, leftover
from tests.identify.simulated import NOISE_RAD_S, TRUTH, white
from tests.rig.effects.values import VALUES


def share(found: Share | None) -> float:
    """What is told of it."""
    return found.share if is_significant(found) and found is not None else 0.0


@pytest.mark.parametrize("seed", [0, 1, 2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(3, 10))])
def test_of_a_clean_platform_with_white_noise_nothing_is_said(seed: int) -> None:
    found = diagnosed(seed=seed)
    assert found.harmonics is not None
    assert not is_significant(found.harmonics.repeats)
    assert not is_significant(found.direction) and not is_significant(found.memory, WORTH_OF_PAST)
    assert found.free_lines == ()
    (only,) = diagnosis_sentences(found, "rotary")
    assert "shows no structure" in only


@pytest.mark.parametrize("name", ["cubic_stiffness", "torque_saturation", "backlash", "coulomb_friction"])
def test_what_acts_alike_on_both_sides_leaves_odd_harmonics(name: str) -> None:
    found = diagnosed({name: VALUES[name]}).harmonics
    assert found is not None
    assert share(found.odd) > 0.4
    assert share(found.even) == 0.0
    assert share(found.repeats) > 0.9
    assert found.orders[3] == max(v for k, v in found.orders.items() if k > 1)


@pytest.mark.parametrize("name", ["quadratic_stiffness", "bilinear_stiffness", "directional_damping", "unbalance"])
def test_what_differs_from_side_to_side_leaves_even_harmonics(name: str) -> None:
    found = diagnosed({name: VALUES[name]}).harmonics
    assert found is not None
    assert share(found.even) > 0.5
    assert share(found.odd) == 0.0
    assert max(found.orders, key=lambda k: found.orders[k]) == 2


@pytest.mark.parametrize("hertz", [13.37, 17.3, 50.0])
def test_a_pump_is_a_free_line_at_its_frequency_and_size_and_nothing_else(hertz: float) -> None:
    found = diagnosed({"periodic_disturbance": {"sine": 0.05, "cosine": 0.06, "frequency": hertz}})
    (line,) = found.free_lines
    assert line.frequency_hz == pytest.approx(hertz, abs=0.1)
    assert line.size == pytest.approx(np.hypot(0.05, 0.06), rel=0.1), "N m"
    assert not is_significant(found.direction) and not is_significant(found.memory, WORTH_OF_PAST)


def test_a_free_line_beside_multiples_of_most_sets_is_no_harmonic() -> None:
    found = diagnosed({"periodic_disturbance": {"sine": 0.05, "cosine": 0.06, "frequency": 11.96}})
    (line,) = found.free_lines
    assert line.frequency_hz == pytest.approx(11.96, abs=0.1), "no multiple of 9 Hz"
    assert found.harmonics is not None
    assert share(found.harmonics.even) == 0.0
    assert share(found.harmonics.odd) == 0.0


def test_harmonics_of_the_excitation_are_no_free_lines() -> None:
    for name in ("cubic_stiffness", "quadratic_stiffness", "coulomb_friction", "cogging"):
        assert diagnosed({name: VALUES[name]}).free_lines == (), name


def test_friction_changes_sign_with_the_direction_and_a_spring_does_not() -> None:
    assert share(diagnosed({"coulomb_friction": VALUES["coulomb_friction"]}).direction) > 0.4
    assert share(diagnosed({"quadratic_damping": VALUES["quadratic_damping"]}).direction) > 0.4
    assert share(diagnosed({"cubic_stiffness": VALUES["cubic_stiffness"]}).direction) == 0.0


@pytest.mark.parametrize("name", ["hysteresis", "creep"])
def test_what_remembers_is_told_as_memory(name: str) -> None:
    found = diagnosed({name: VALUES[name]})
    assert found.memory is not None
    assert is_significant(found.memory, WORTH_OF_PAST)
    assert found.memory.share > 0.5


@pytest.mark.parametrize("name", ["coulomb_friction", "stribeck_friction", "cubic_stiffness", "backlash",
                                  "quadratic_stiffness", "stiffness_drift", "cogging"])  # fmt: skip
def test_what_knows_only_the_present_is_no_memory(name: str) -> None:
    assert not is_significant(diagnosed({name: VALUES[name]}).memory, WORTH_OF_PAST)


def test_the_sentences_name_shares_orders_and_what_makes_them() -> None:
    said = " ".join(diagnosis_sentences(diagnosed({"cubic_stiffness": VALUES["cubic_stiffness"]}), "rotary"))
    assert "times the level of the sensor's noise" in said
    assert "in odd harmonics (3rd 5" in said
    assert "cubic spring" in said and "even" not in said and "direction" not in said
    pump = diagnosed({"periodic_disturbance": {"sine": 0.08, "cosine": 0.0, "frequency": 17.3}})
    line = diagnosis_sentences(pump, "rotary")[-1]
    assert line.startswith("A spectral line at 17.3") and "is not a harmonic of any excitation" in line
    assert "N·m" in line


def test_a_linear_axis_is_spoken_of_in_its_own_words() -> None:
    said = " ".join(diagnosis_sentences(diagnosed({"hysteresis": VALUES["hysteresis"]}), "linear"))
    assert "force residual" in said and "position" in said
    assert "torque" not in said and "angle" not in said


def test_samples_that_do_not_count_are_not_looked_at() -> None:
    runs, over = leftover()
    spoiled = [
        replace(
            r,
            keep=np.where(np.abs(r.time_s - 2.0) < 0.1, 0.0, 1.0),
            torque_residual_after=np.where(np.abs(r.time_s - 2.0) < 0.1, 50.0, np.asarray(r.torque_residual_after)),
        )
        for r in runs
    ]
    assert len(diagnosis_sentences(diagnosis_of(spoiled, over), "rotary")) == 1


def test_of_too_little_nothing_is_told() -> None:
    runs, _ = leftover()
    short = [replace(r, keep=np.where(r.time_s < 0.2, 1.0, 0.0)) for r in runs[:1]]
    assert diagnose(short, Sensor(NOISE_RAD_S, Platform(*TRUTH), 100.0), (1.0, 1.0), ("N*m", "rad/s")) == ()
    assert diagnose([], Sensor(NOISE_RAD_S, None, None), (None, None), ("N*m", "rad/s")) == ()


def test_a_decay_has_its_free_lines_and_no_more() -> None:
    runs, _ = leftover()
    seconds = np.arange(20_000) * 1e-3

    def free(hum: float) -> RunTraces:
        left = white(len(seconds), 1e-3, seed=3) + hum * np.sin(2 * np.pi * 7.7 * seconds)
        motion = np.sin(2 * np.pi * 29.0 * seconds) * np.exp(-seconds)
        zeros = np.zeros(len(seconds))
        return replace(
            runs[0], time_s=seconds, measured=motion + left, simulated_before=motion, simulated_after=motion,
            keep=zeros + 1.0, torque_nm=None, torque_residual_before=None, torque_residual_after=None,
            angle_rad=motion, rate_rad_s=motion, holdout=zeros, frequency_hz=None,
        )  # fmt: skip

    quiet, humming = (diagnosis_of([free(size)]) for size in (0.0, 1e-3))
    assert quiet.free_lines == () and quiet.harmonics is None and quiet.memory is None
    assert humming.free_lines[0].frequency_hz == pytest.approx(7.7, abs=0.02)
    assert humming.unit == "rad/s"


def test_what_the_swing_of_a_decay_leaves_near_its_own_frequency_is_no_free_line() -> None:
    runs, _ = leftover()
    seconds = np.arange(10_000) * 1e-2
    swing = np.exp(-0.005 * seconds) * np.sin(2 * np.pi * 0.93 * seconds)
    left = 1e-2 * np.exp(-0.005 * seconds) * np.sin(2 * np.pi * (0.92 * seconds + 1e-4 * seconds**2))
    zeros = np.zeros(len(seconds))
    run = replace(
        runs[0], time_s=seconds, measured=swing + left + white(len(seconds), 1e-3), simulated_before=swing,
        simulated_after=swing, keep=zeros + 1.0, torque_nm=None, torque_residual_before=None,
        torque_residual_after=None, angle_rad=swing, rate_rad_s=np.gradient(swing, 1e-2), holdout=zeros,
        frequency_hz=None,
    )  # fmt: skip
    found = diagnosis_of([run], 8.0)
    assert found.free_lines == ()
    assert diagnosis_sentences(found, "rotary")[0].endswith("it shows no free lines.")
