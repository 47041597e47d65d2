"""Excitation sets are pure functions of time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from rig.config.excitation import ExcitationConfig
from rig.excitation import ExcitationSet, Multisine, Sine, planned

KINDS: list[dict[str, Any]] = [
    {"torque_nm": 300, "frequency_hz": 0.5},
    {"kind": "sine", "torque_nm": 40, "frequency_hz": 9, "soft_start_s": 2},
    {"kind": "ramp_hold_release", "torque_nm": -30, "ramp_s": 1, "hold_s": 1, "release_s": 2, "cycles": 2},
    {"kind": "multisine", "torque_nm": 80, "from_hz": 0.5, "to_hz": 40},
    {"kind": "multisine", "torque_nm": 80, "frequencies_hz": [1, 3, 9], "phases": "random", "seed": 4},
    {"kind": "chirp", "torque_nm": 50, "from_hz": 0.5, "to_hz": 20},
    {"kind": "chirp", "torque_nm": 50, "from_hz": 20, "to_hz": 0.5, "sweep": "logarithmic"},
    {"kind": "free_decay", "torque_nm": 60},
]


def made(keys: dict[str, Any]) -> ExcitationSet:
    return ExcitationConfig.model_validate({"sets": [keys]}).sets[0]


def test_without_a_word_the_five_sets_of_the_paper_are_played() -> None:
    sets = ExcitationConfig().sets
    assert [(s.torque_nm, s.frequency_hz, s.duration_s) for s in sets if isinstance(s, Sine)] == [
        (300, 0.5, 10),
        (300, 1, 10),
        (250, 3, 10),
        (200, 6, 10),
        (150, 9, 10),
    ]


def test_a_sine_is_the_formula_of_figure_6() -> None:
    t = np.linspace(0.0, 10.0, 1001)
    sine = Sine(torque_nm=250, frequency_hz=3)
    np.testing.assert_allclose(sine.torque(t), 250 * np.sin(2 * math.pi * 3 * t), atol=1e-12)


@pytest.mark.parametrize("keys", KINDS, ids=lambda k: k.get("kind", "default"))
def test_every_kind_is_zero_outside_its_length_and_never_exceeds_its_torque(keys: dict[str, Any]) -> None:
    s = made(keys)
    t = np.linspace(-1.0, s.duration_s + 1.0, 48_001)
    torque = s.torque(t)
    outside = (t < 0) | (t > s.duration_s)
    assert not torque[outside].any()
    peak = np.abs(torque).max()
    assert 0.99 * abs(keys["torque_nm"]) < peak <= abs(keys["torque_nm"]) * (1 + 1e-3)


@pytest.mark.parametrize("keys", KINDS, ids=lambda k: k.get("kind", "default"))
def test_one_instant_and_an_array_of_instants_give_the_same_torque(keys: dict[str, Any]) -> None:
    s = made(keys)
    instants = [0.0, 0.0123, 1.7, 2.503, 9.999]
    np.testing.assert_allclose([s.torque(t) for t in instants], s.torque(np.array(instants)), atol=1e-9)


def test_a_soft_start_reaches_the_plain_sine_and_stays_below_it_until_then() -> None:
    soft = Sine(torque_nm=100, frequency_hz=6, soft_start_s=2)
    hard = Sine(torque_nm=100, frequency_hz=6)
    early, late = np.linspace(0, 1, 200), np.linspace(2, 10, 200)
    assert np.all(np.abs(soft.torque(early)) <= np.abs(hard.torque(early)))
    np.testing.assert_allclose(soft.torque(late), hard.torque(late))


def test_schroeder_phases_keep_the_peak_lower_than_random_ones() -> None:
    def crest(phases: str) -> float:
        s = made({"kind": "multisine", "torque_nm": 1.0, "from_hz": 0.5, "to_hz": 40, "phases": phases})
        torque = s.torque(np.linspace(0, 10, 40_001))
        return float(np.abs(torque).max() / torque.std())

    assert crest("schroeder") < crest("random")


def test_a_band_is_made_of_whole_cycles_so_that_the_tones_are_orthogonal() -> None:
    s = Multisine(kind="multisine", torque_nm=1, from_hz=0.51, to_hz=7.77, tones=9, duration_s=10)
    t = np.arange(10_000) / 1000.0
    spectrum = np.abs(np.fft.rfft(s.torque(t)))
    assert np.count_nonzero(spectrum > 1e-6 * spectrum.max()) == 9


def test_a_chirp_ends_at_the_frequency_it_was_asked_to() -> None:
    s = made({"kind": "chirp", "torque_nm": 1, "from_hz": 1, "to_hz": 20, "sweep": "logarithmic"})
    t = np.linspace(0, 10, 1_000_001)
    crossings = t[1:][np.diff(np.sign(s.torque(t))) != 0]
    assert 0.5 / (crossings[1] - crossings[0]) == pytest.approx(1.0, rel=0.25)
    assert 0.5 / (crossings[-1] - crossings[-2]) == pytest.approx(20.0, rel=0.05)


def test_free_decay_lets_go_and_stays_at_zero() -> None:
    s = made({"kind": "free_decay", "torque_nm": 60, "pull_s": 2, "hold_s": 0.5})
    assert s.torque(2.25) == pytest.approx(60)
    assert not s.torque(np.linspace(2.52, 10, 100)).any()


def test_repeats_follow_their_set_and_every_name_is_taken_once() -> None:
    sine = Sine(torque_nm=100, frequency_hz=1, repeat_scales=(0.5,))
    plan = planned([sine, sine])
    assert [s.name for s in plan] == ["1 Hz", "1 Hz x0.5", "1 Hz (2)", "1 Hz x0.5 (2)"]
    assert plan[1].torque(0.25) == pytest.approx(50)
    assert plan[1].scaled(0.1).torque(0.25) == pytest.approx(5)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"kind": "sin", "torque_nm": 3, "frequency_hz": 1}, "ramp_hold_release"),
        ({"torque_nm": -3, "frequency_hz": 1}, "greater than 0"),
        ({"torque_nm": 3}, "frequency_hz"),
        ({"torque_nm": 3, "frequency_hz": 1, "frequncy": 1}, "frequncy"),
        ({"kind": "multisine", "torque_nm": 3}, "either frequencies_hz or both"),
        ({"kind": "multisine", "torque_nm": 3, "from_hz": 9, "to_hz": 1}, "must lie below"),
        ({"kind": "free_decay", "torque_nm": 3, "duration_s": 2}, "lengthen duration_s"),
        ({"kind": "ramp_hold_release", "torque_nm": 3, "cycles": 9}, "lengthen duration_s"),
    ],
)
def test_a_wrong_set_is_refused_with_what_would_be_right(keys: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError) as refused:
        made(keys)
    assert said in str(refused.value)


def test_an_empty_list_of_sets_is_refused() -> None:
    with pytest.raises(ValidationError, match="1 to 200"):
        ExcitationConfig.model_validate({"sets": []})
