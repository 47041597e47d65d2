"""A gyro that filters what it measures: its noise is no missing effect, and hides none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import signal

from identify.diagnose import torque_sensor_noise
from identify.pipeline import identify
from identify.results import Identification
from rig.config.identify import IdentifyConfig
from rig.recording.run import Array, Recording, Run
from tests.identify.simulated import DECLARED, NOISE_RAD_S, SETS, TRUTH, Effects, sine_run, white

CUBIC = {"cubic_stiffness": {"factor": 300.0}}


def passed(order: int, hertz: float) -> Callable[[Array], Array]:
    """Noise behind a Butterworth low-pass."""
    b, a = signal.butter(order, hertz, fs=1000.0)
    return lambda noise: np.asarray(signal.lfilter(b, a, noise))


def recorded(
    colour: Callable[[Array], Array] | None, effects: Effects | None = None, seed: int = 0, duration_s: float = 2.5,
    sets: Sequence[tuple[float, float]] = SETS,
) -> Recording:  # fmt: skip
    """The paper's sets, read by a gyro of that noise."""
    runs = []
    for i, (m, f) in enumerate(sets):
        run = sine_run(m, f, effects=effects, noise=1e-9 if colour else NOISE_RAD_S, seed=i, duration_s=duration_s)
        assert run.rate_rad_s is not None
        if colour:
            noise = colour(white(len(run.rate_rad_s) + 2000, NOISE_RAD_S, 10 * seed + i))[2000:]
            run = replace(run, rate_rad_s=run.rate_rad_s + noise)
        runs.append(run)
    return Recording(tuple(runs))


def found_in(recording: Recording, candidates: list[str] | None) -> Identification:
    """What is found among some candidates, or among all effects."""
    return identify(recording, DECLARED, IdentifyConfig(candidates=None if candidates is None else tuple(candidates)))


@cache
def found_without_its_effect() -> Identification:
    """Such noise beside a stiffness that no candidate describes."""
    return found_in(recorded(passed(2, 100.0), CUBIC), [])


def assert_right(found: Identification) -> None:
    """Accepted, and J, C and K within three and a half standard errors."""
    assert found.accepted, found.reasons
    for term, truth in zip(("inertia", "damping", "stiffness"), TRUTH, strict=True):
        estimate = found.final.parameters[term]
        assert abs(estimate.value - truth) < 3.5 * estimate.std_error


@pytest.mark.slow
@pytest.mark.parametrize(("order", "hertz"), [(2, 50.0), (1, 60.0), (8, 100.0)])
def test_noise_that_the_gyro_filters_is_no_missing_effect(order: int, hertz: float) -> None:
    """Dense at the bottom of the spectrum, it had passed for lines: ``unexplained``."""
    found = found_in(recorded(passed(order, hertz), duration_s=4.0, sets=SETS[2:]), [])
    assert_right(found)
    assert found.verdict.effects == ()
    assert not found.verdict.unexplained


@pytest.mark.slow
def test_a_cubic_spring_beside_such_noise_is_found_among_all_effects() -> None:
    """Its fit had stayed where all that is wrong is disturbance: gravity was named, and K 3.7 times too large."""
    found = found_in(recorded(passed(2, 100.0), CUBIC), None)
    assert_right(found)
    assert found.verdict.effects == ("cubic_stiffness",)
    assert not found.verdict.unexplained


@pytest.mark.slow
@pytest.mark.parametrize(
    ("order", "hertz", "name", "hidden"),
    [
        (2, 100.0, "cubic_stiffness", {"factor": 300.0}),
        # No noise where it is read: the search is far off first.
        (8, 100.0, "creep", {"stiffness": 30.0, "time": 0.1}),
    ],
)
def test_an_effect_beside_such_noise_is_named(order: int, hertz: float, name: str, hidden: dict[str, float]) -> None:
    found = found_in(recorded(passed(order, hertz), {name: hidden}, sets=SETS[2:]), [name, "quadratic_stiffness"])
    assert found.verdict.effects == (name,)
    assert found.accepted and not found.verdict.unexplained
    assert found.final.effect_parameters[name][next(iter(hidden))].value == pytest.approx(
        hidden[next(iter(hidden))], rel=0.01
    )


@pytest.mark.slow
def test_an_effect_that_is_not_offered_is_no_noise() -> None:
    found = found_without_its_effect()
    assert found.verdict.unexplained
    # What is left is 0.4 % of the torque; how far it moves J and K is how far these are off, start angle included.
    assert found.disturbance is not None
    for term, truth in zip(("inertia", "stiffness"), (TRUTH[0], TRUTH[2]), strict=True):
        off = 100.0 * abs(found.final.parameters[term].value / truth - 1.0)
        assert found.disturbance.moves_percent[term] == pytest.approx(off, rel=0.1)


@pytest.mark.slow
def test_noise_in_the_recorded_torque_is_told_as_a_torque() -> None:
    runs = recorded(None, duration_s=4.0).runs
    noisy = [
        replace(r, torque_nm=r.torque_nm + white(len(r.torque_nm), 3.0, i))
        for i, r in enumerate(runs)
        if r.torque_nm is not None
    ]
    found = found_in(Recording(tuple(noisy)), [])
    assert found.disturbance is not None and found.disturbance.relative < 0.01, "most of it is filtered"
    assert found.disturbance.depends_on == ()
    assert 0.1 < found.disturbance.torque_rms < 1.0  # of 3 N m a sample: what lies in the band of the motion


@pytest.mark.slow
@pytest.mark.parametrize("filtered", [True, False])
def test_what_a_clean_torque_leaves_is_not_blamed_on_its_noise(filtered: bool) -> None:
    found = found_without_its_effect() if filtered else found_in(recorded(None, CUBIC), [])
    assert found.verdict.unexplained
    assert torque_sensor_noise.describe(found) == ""


@pytest.mark.slow
def test_two_runs_of_different_noise_are_right() -> None:
    runs = recorded(passed(2, 100.0)).runs
    other = recorded(passed(2, 50.0), seed=1).runs[4]
    assert_right(found_in(Recording((runs[2], runs[3], other)), []))


@pytest.mark.slow
def test_a_drive_whose_gain_goes_with_the_angle_is_no_noise_under_multisines() -> None:
    """All bins of a multisine as long as its run answer to it: on a damped platform that had passed for noise."""
    runs = [damped_multisine(seed) for seed in range(2)]
    found = found_in(Recording(tuple(runs)), ["coulomb_friction"])
    assert found.verdict.effects == ()
    assert found.verdict.unexplained
    assert found.disturbance is not None and "angle" in {d.on for d in found.disturbance.depends_on}


def damped_multisine(seed: int) -> Run:
    """A platform at 3.5 Hz, damped by 0.9, whose torque is 1 + 0.3 theta times the recorded one."""
    rng = np.random.default_rng(seed)
    inertia, own = 0.02, 2.0 * np.pi * 3.5
    damping, stiffness = 1.8 * inertia * own, inertia * own**2
    step = 5e-4
    time = step * np.arange(round(10.0 / step) + 1)
    hertz = np.arange(3, 59) / 10.0
    phases = rng.uniform(0.0, 2.0 * np.pi, len(hertz))
    torque = np.sum(np.sin(2.0 * np.pi * hertz[:, None] * time + phases[:, None]), axis=0)
    torque *= 0.7 / np.std(torque)
    state, angle, rate = np.zeros(2), np.zeros(len(time)), np.zeros(len(time))

    def slope(x: Array, m: float) -> Array:
        return np.array([x[1], (m * (1.0 + 0.3 * x[0]) - damping * x[1] - stiffness * x[0]) / inertia])

    for i in range(len(time) - 1):
        angle[i], rate[i] = state
        middle = 0.5 * (torque[i] + torque[i + 1])
        a = slope(state, torque[i])
        b = slope(state + 0.5 * step * a, middle)
        c = slope(state + 0.5 * step * b, middle)
        state = state + step / 6.0 * (a + 2.0 * b + 2.0 * c + slope(state + step * c, torque[i + 1]))
    angle[-1], rate[-1] = state
    noisy = rate[::2] + white(len(rate[::2]), NOISE_RAD_S, seed)
    return Run(
        f"multisine {seed}", time[::2], np.ones(len(noisy), bool), rate_rad_s=noisy, torque_time_s=time[::2],
        torque_nm=torque[::2],
    )  # fmt: skip
