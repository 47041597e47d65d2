"""Measurements from rigs that nobody here made, read from their files and identified."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import optimize, signal
from scipy.integrate import solve_ivp

from identify.pipeline import identify
from identify.results import Identification
from rig.arrays import Array
from rig.config.load import load_config
from rig.platform import Platform
from rig.recording.load import read_recording
from rig.recording.run import Recording

DATA = Path(__file__).parents[3] / "shared" / "data"
LORENZ_RUN = "{{file: {file}, use: {use}, min_rate_rad_s: 1.0, to_s: {to_s}}}"
LORENZ_S = 11.0  # all of a run


def needs(folder: str) -> pytest.MarkDecorator:
    return pytest.mark.skipif(not (DATA / folder).is_dir(), reason=f"no recordings in {DATA / folder}")


@cache
def identified(text: str) -> tuple[Recording, Identification]:
    """A recorded campaign as its configuration says, identified once for all tests."""
    import tempfile  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "campaign.yaml"
        path.write_text(text, encoding="utf-8")
        loaded = load_config(path)
        recording = read_recording(loaded)
        return recording, identify(recording, loaded.config.model.platform(), loaded.config.identify)


def lorenz(
    candidates: str = "", numbers: Sequence[int] = range(1, 6), to_s: float = LORENZ_S
) -> tuple[Recording, Identification]:
    """Runs 1 to 3 to fit, 4 and 5 to judge; the declared model is a guess, stiffness included."""
    runs = [
        LORENZ_RUN.format(file=DATA / "lorenz_servo" / f"run0{i}.npz", use="fit" if i < 4 else "holdout", to_s=to_s)
        for i in numbers
    ]
    return identified(
        "backend: recorded\n"
        "model: {inertia_kg_m2: 1.0e-3, damping_nm_s_rad: 1.0e-3, stiffness_nm_rad: 0.01}\n"
        f"identify: {{lowpass_hz: 15{candidates}}}\n"
        f"recorded: {{runs: [{', '.join(runs)}]}}\n"
    )


def emps(settings: str = "") -> tuple[Recording, Identification]:
    """One run in closed loop; the tool chooses what it holds out."""
    return identified(
        "backend: recorded\n"
        "model: {inertia_kg_m2: 30.0, damping_nm_s_rad: 50.0, stiffness_nm_rad: 10.0}\n"
        f"identify: {{{settings}}}\n"
        f"recorded: {{axis: linear, runs: [{{file: {DATA / 'emps' / 'emps_train.npz'}}}],\n"
        "  columns: {time: t_s, angle: q_m, torque: force_N}}\n"
    )


def pendulum() -> tuple[Recording, Identification]:
    """A free decay: no torque, so that ratios to the inertia are all there is."""
    file = DATA / "pendulum_decay" / "pendulum_b.npz"
    return identified(
        "backend: recorded\n"
        f"recorded: {{runs: [{{file: {file}, from_s: 5.0, to_s: 118.0}}], columns: {{time: t_s, angle: theta_rad}}}}\n"
    )


@needs("lorenz_servo")
def test_among_a_few_candidates_the_servo_has_coulomb_friction_and_a_constant_torque() -> None:
    few = ", candidates: [coulomb_friction, torque_offset]"
    _, found = lorenz(few, (1, 4), 6.0)
    assert found.verdict.effects[:2] == ("coulomb_friction", "torque_offset")
    assert found.final.error.holdout_torque_relative is not None
    assert found.final.error.holdout_torque_relative <= 0.065


@needs("lorenz_servo")
@pytest.mark.slow
def test_the_servo_has_coulomb_friction_first_and_then_a_constant_torque() -> None:
    _, found = lorenz()
    assert found.verdict.effects[:2] == ("coulomb_friction", "torque_offset")


@needs("lorenz_servo")
@pytest.mark.slow
def test_the_servo_has_no_stiffness_and_none_is_claimed() -> None:
    _, found = lorenz()
    assert "stiffness" not in found.final.parameters
    assert any(d.name == "stiffness" and d.reason for d in found.final.dropped)


@needs("lorenz_servo")
@pytest.mark.slow
def test_the_servos_held_out_error_falls_from_a_third_to_six_percent_of_the_torque() -> None:
    _, found = lorenz()
    assert found.before.error.lowpass_hz == 15.0
    assert found.before.error.holdout_torque_relative == pytest.approx(0.33, abs=0.02)
    assert found.final.error.holdout_torque_relative is not None
    assert found.final.error.holdout_torque_relative <= 0.065


@needs("lorenz_servo")
@pytest.mark.slow
def test_the_servos_figures_hold_when_they_are_computed_anew_outside_the_identifier() -> None:
    recording, found = lorenz()
    platform = found.final.platform
    assert platform is not None
    level = platform.effects["coulomb_friction"]["level"]
    offset = platform.effects["torque_offset"]["level"]
    sos = signal.butter(4, 15.0, fs=1000.0, output="sos")
    residual, torque = [], []
    for run in recording.runs[3:]:
        assert run.rate_rad_s is not None and run.torque_nm is not None
        rate = run.rate_rad_s
        columns = [np.gradient(rate, run.time_s), rate, np.sign(rate), np.ones_like(rate), run.torque_nm]
        a, w, sign, one, m = (signal.sosfiltfilt(sos, x) for x in columns)
        left = m - platform.inertia_kg_m2 * a - platform.damping_nm_s_rad * w - level * sign - offset * one
        fast = np.abs(rate) > 1.0
        residual.append(left[fast])
        torque.append(m[fast])
    assert np.linalg.norm(np.concatenate(residual)) / np.linalg.norm(np.concatenate(torque)) <= 0.068


@needs("lorenz_servo")
@pytest.mark.slow
def test_the_servos_parameters_are_those_of_a_plain_regression_and_near_its_own_document() -> None:
    _, found = lorenz()
    assert found.final.parameters["inertia"].value == pytest.approx(1.77e-4, rel=0.03)
    assert found.final.parameters["inertia"].value == pytest.approx(1.6846e-4, rel=0.06)
    assert found.final.parameters["damping"].value == pytest.approx(8.2285e-5, rel=0.4)
    assert found.final.effect_parameters["coulomb_friction"]["level"].value == pytest.approx(0.0165, rel=0.2)


@needs("emps")
@pytest.mark.slow
def test_the_linear_axis_has_coulomb_friction_and_a_constant_force_and_no_stiffness() -> None:
    _, found = emps()
    assert {"coulomb_friction", "torque_offset"} <= set(found.verdict.effects)
    assert found.verdict.effects[0] == "coulomb_friction"
    assert "stiffness" not in found.final.parameters


@needs("emps")
@pytest.mark.slow
def test_the_linear_axis_is_predicted_to_a_few_percent_of_the_force() -> None:
    _, found = emps()
    before, after = found.before.error.holdout_torque_relative, found.final.error.holdout_torque_relative
    assert before is not None and after is not None
    assert after <= 0.045 < before
    assert found.final.error.lowpass_hz is not None


@needs("emps")
@pytest.mark.slow
def test_mass_and_friction_of_the_linear_axis_are_the_published_ones() -> None:
    """Its friction is no step at a reversal: the likelihood's own level is 8.6 N, beside a slow force for the rest."""
    _, found = emps()
    mass = found.final.parameters["inertia"]
    assert mass.unit == "kg"
    assert mass.value == pytest.approx(95.1089, rel=0.03)
    assert found.final.effect_parameters["coulomb_friction"]["level"].value == pytest.approx(20.3935, rel=0.05)


@needs("emps")
@pytest.mark.slow
def test_friction_that_depends_on_the_direction_explains_all_but_a_fortieth_of_the_linear_axis_force() -> None:
    """Behind a low-pass of 20 Hz, well above the motion: the drive's own band is not what was asked."""
    _, found = emps("lowpass_hz: 20")
    assert found.verdict.effects == ("coulomb_friction", "torque_offset", "directional_damping")
    before, after = found.before.error, found.final.error
    assert before.holdout_torque_relative is not None and before.holdout_torque_relative > 0.15
    assert after.residual_torque_relative is not None and after.residual_torque_relative <= 0.025
    assert after.holdout_torque_relative is not None and after.holdout_torque_relative <= 0.025
    assert found.final.effect_parameters["coulomb_friction"]["level"].value == pytest.approx(20.3935, rel=0.03)


@needs("pendulum_decay")
@pytest.mark.slow
def test_the_pendulum_shows_gravity_then_friction_then_drag_and_gives_ratios_to_its_inertia() -> None:
    _, found = pendulum()
    assert {"inertia", "damping", "stiffness"}.isdisjoint(found.final.parameters)
    # Dry friction that lets go over 3 mrad predicts the swing three times better than one that lets go at once.
    assert set(found.verdict.effects) == {"unbalance", "presliding_friction", "quadratic_damping"}
    assert found.noise_floor.residual_rms_torque is None
    # Gravity over inertia is the square of the small swing's frequency.
    platform = found.final.platform
    assert platform is not None
    assert np.sqrt(platform.effects["unbalance"]["sine"]) == pytest.approx(swing_rad_s(), rel=0.02)
    assert platform.effects["presliding_friction"]["level"] == pytest.approx(0.0539, rel=0.03)
    assert free_run_error_of_the_pendulum(platform) < 0.008


def free_run_error_of_the_pendulum(platform: Platform) -> float:
    """Root mean square error over the signal's, 5 to 118 s, by another integrator; only the start is fitted."""
    contents = np.load(DATA / "pendulum_decay" / "pendulum_b.npz")
    time, angle = contents["t_s"], contents["theta_rad"]
    used = (time >= 5.0) & (time <= 118.0)
    time, angle = time[used][::10], angle[used][::10]
    e = platform.effects
    sine, cosine = e["unbalance"]["sine"], e["unbalance"]["cosine"]
    level, within = e["presliding_friction"]["level"], e["presliding_friction"]["displacement"]
    drag = e["quadratic_damping"]["factor"]

    def slope(_: float, y: Array) -> list[float]:
        friction = level * y[2] + drag * y[1] * abs(y[1]) + platform.damping_nm_s_rad * y[1]
        pull = sine * np.sin(y[0]) + cosine * np.cos(y[0]) + platform.stiffness_nm_rad * y[0]
        return [y[1], -(pull + friction), (y[1] - abs(y[1]) * y[2]) / within]

    def residual(start: Array) -> Array:
        begin = [*start, np.sign(start[1])]  # it slides
        return np.asarray(solve_ivp(slope, (time[0], time[-1]), begin, t_eval=time, rtol=1e-7, atol=1e-9).y[0] - angle)

    rate = float(np.polyfit(time[:8], angle[:8], 1)[0])
    fitted = optimize.least_squares(residual, [angle[0], rate], diff_step=1e-4)
    return float(np.std(fitted.fun) / np.std(angle))


def swing_rad_s() -> float:
    """Angular frequency of the last, small swings, counted from zero crossings."""
    contents = np.load(DATA / "pendulum_decay" / "pendulum_b.npz")
    time, angle = contents["t_s"], contents["theta_rad"]
    late = (time > 60) & (time < 100)
    t, th = time[late], signal.savgol_filter(angle[late] - np.mean(angle[late]), 51, 3)
    up = np.nonzero((th[:-1] < 0) & (th[1:] >= 0))[0]
    return float(2 * np.pi * (len(up) - 1) / (t[up[-1]] - t[up[0]]))
