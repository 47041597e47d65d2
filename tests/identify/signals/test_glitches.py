"""Spikes are left out and described; corners of the rate, lines and steep motion are not taken for spikes."""

from __future__ import annotations

import numpy as np
import pytest

from identify.signals.glitches import GLITCH_SIGMAS, MAX_GLITCHES, describe, glitches
from identify.signals.prepare import prepare
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Array, Run
from tests.identify.simulated import white

NOISE = 1e-3
TIME = np.arange(10_001) * 1e-3


def measured(effects: dict[str, dict[str, float]] | None = None, hertz: float = 3.0, seed: int = 0) -> Array:
    torque = TorqueSignal(TIME, 60.0 * np.sin(2 * np.pi * hertz * TIME))
    rate = simulate(Platform(effects=effects or {}), TIME, torque).rate_rad_s
    return np.asarray(rate + white(len(TIME), NOISE, seed))


def found(values: Array) -> list[int]:
    return np.flatnonzero(glitches(values, np.ones(len(values), bool), NOISE)).tolist()


@pytest.mark.parametrize("where", [[3], [10_000], [0, 4321, 10_000], [200, 208, 5000, 9000]])
@pytest.mark.parametrize("size", [400.0, -1e5])
def test_spikes_are_found_wherever_they_are(where: list[int], size: float) -> None:
    values = measured({"coulomb_friction": {"level": 0.2}})
    values[where] += size * NOISE
    assert found(values) == where


@pytest.mark.parametrize("hertz", [0.5, 9.0])
@pytest.mark.parametrize(
    "effects",
    [{}, {"coulomb_friction": {"level": 3.0}}, {"stribeck_friction": {"coulomb": 2.0, "static": 4.0, "speed": 0.05}}],
    ids=["linear", "coulomb", "stribeck"],
)
def test_what_the_platform_does_is_no_glitch(effects: dict[str, dict[str, float]], hertz: float) -> None:
    assert found(measured(effects, hertz)) == []


def test_what_comes_often_is_no_glitch() -> None:
    values = measured()
    values[500 :: len(values) // (MAX_GLITCHES + 2)] += 100 * NOISE
    assert found(values) == []


def test_a_sample_that_does_not_count_is_neither_judged_nor_a_judge() -> None:
    values = measured()
    values[3000] += 1.0
    usable = np.ones(len(values), bool)
    usable[3000] = False
    assert not np.any(glitches(values, usable, NOISE))


def test_a_spike_costs_its_own_sample_and_the_noise_is_the_noise() -> None:
    values = measured()
    values[[2000, 10_000]] += 800 * NOISE
    run = Run("1 Hz", TIME + 5.0, np.ones(len(TIME), bool), rate_rad_s=values)
    trace = prepare(run)
    assert trace.glitches_s.tolist() == pytest.approx([7.0, 15.0])
    assert np.flatnonzero(~trace.keep).tolist() == [2000, 10_000]
    assert trace.noise == pytest.approx(NOISE, rel=0.05)
    assert abs(trace.measured[2000] - values[1999]) < 0.2


def test_it_is_told_where_they_were() -> None:
    said = describe([("a", np.array([1.5])), ("b", np.zeros(0)), ("c", np.array([2.0, 3.25]))])
    assert said.startswith(f"3 samples deviate by more than {GLITCH_SIGMAS:g} times the noise")
    assert said.endswith("excluded: a at 1.5 s; c at 2, 3.25 s")
    assert describe([("a", np.zeros(0))]) == ""
