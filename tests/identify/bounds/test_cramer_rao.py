"""What a campaign can determine is said before it moves, and the bound agrees with an independent one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from identify.bounds import advice
from identify.bounds.cramer_rao import Information, information_of, of_planned, planned_trace, together, with_delay
from identify.bounds.planned import of_planned_campaign
from identify.bounds.recorded import of_recorded_campaign
from rig.excitation import Sine, planned
from rig.platform import Platform
from rig.recording.run import Array, Recording
from tests.identify.simulated import NOISE_RAD_S, SETS, TRUTH, decay_run

J, C, K = ("inertia",), ("damping",), ("stiffness",)
PAPER = Platform(*TRUTH)
SHORT_S = 4.0


def sines(*pairs: tuple[float, float], soft_start_s: float = 0.0, duration_s: float = SHORT_S) -> tuple[Sine, ...]:
    return tuple(Sine(torque_nm=m, frequency_hz=f, soft_start_s=soft_start_s, duration_s=duration_s) for m, f in pairs)


def told(*sets: Sine, platform: Platform = PAPER, noise: float | None = NOISE_RAD_S) -> list[str]:
    return of_planned_campaign(platform, planned(sets), 1000.0, noise)


def alone(*sets: Sine, platform: Platform = PAPER) -> tuple[Information, ...]:
    return of_planned(platform, planned(sets), 1000.0, NOISE_RAD_S)


def rate_in_closed_form(jck: Array, torque_nm: float, frequency_hz: float, time: Array) -> Array:
    j, c, k = jck
    w = 2.0 * math.pi * frequency_hz
    steady = torque_nm / (k - j * w * w + 1j * c * w)
    pole = (-c + np.sqrt(complex(c * c - 4.0 * j * k))) / (2.0 * j)
    real, imaginary = np.linalg.solve([[1.0, 0.0], [pole.real, -pole.imag]], [-steady.imag, -(1j * w * steady).imag])
    ring = complex(real, imaginary) * pole * np.exp(pole * time)
    return np.asarray((steady * 1j * w * np.exp(1j * w * time)).imag + ring.real)


def test_with_the_start_known_the_bound_is_that_of_the_closed_solution() -> None:
    time = np.arange(4001) * 1e-3
    jck = np.array(TRUTH)
    columns = []
    for i in range(3):
        h = np.zeros(3)
        h[i] = 1e-5 * jck[i]
        ahead, behind = (rate_in_closed_form(jck + s * h, 111.0, 0.5, time) for s in (1, -1))
        columns.append((ahead - behind) / 2e-5)
    a = np.stack(columns, axis=1) / NOISE_RAD_S
    expected = np.sqrt(np.diag(np.linalg.inv(a.T @ a)))
    (found,) = alone(*sines((111.0, 0.5)))
    assert [found.if_known().relative(n) for n in (J, C, K)] == pytest.approx(expected, rel=1e-3)


def test_unknown_start_and_bias_cost_damping_most() -> None:
    (found,) = alone(*sines((111.0, 0.5)))
    known = found.if_known()
    assert found.relative(C) > 1.2 * known.relative(C)
    assert found.relative(J) == pytest.approx(known.relative(J), rel=0.05)


def test_information_of_several_sets_adds() -> None:
    each = alone(*sines(*SETS))
    total = together(each)
    assert total.matrix == pytest.approx(sum(i.matrix for i in each))
    assert all(total.relative(n) < min(i.relative(n) for i in each) for n in (J, C, K))
    assert total.rank == 3
    assert total.condition < 30.0


def test_the_five_sets_determine_everything_alone_and_together() -> None:
    lines = told(*sines(*SETS))
    assert not any("cannot" in line or "NOT" in line for line in lines)
    assert any(
        line.startswith("all sets together: expected J ± 0.0") and "all 3 parameters are determined" in line
        for line in lines
    )
    assert "if the delay is also fitted: delay ± " in lines[-1]


def test_one_steady_sine_with_soft_start_does_not_separate_inertia_from_stiffness() -> None:
    for frequency in (0.5, 6.0):
        lines = told(*sines((60.0, frequency), soft_start_s=1.5))
        assert any("alone cannot separate inertia from stiffness: keep the start transient" in line for line in lines)
        assert any(
            "all sets together" in line and "NOT determined" in line and "soft_start_s: 0" in line for line in lines
        )


def test_a_second_frequency_is_named_as_the_cure() -> None:
    lines = told(*sines((60.0, 0.5), (60.0, 6.0), soft_start_s=1.5))
    assert any("0.5 Hz soft alone cannot" in line and "fit it with 6 Hz soft" in line for line in lines)
    assert not any("NOT determined: J" in line for line in lines)


def test_one_steady_sine_does_not_separate_a_delay_from_damping() -> None:
    assert any("delay cannot be separated from damping" in line for line in told(*sines((60.0, 6.0), soft_start_s=2.0)))


def test_a_set_below_the_noise_is_told_how_much_more_torque_it_needs() -> None:
    lines = told(*sines((0.003, 1.0)))
    (line,) = [line for line in lines if line.startswith("1 Hz: below the noise")]
    factor = float(line.split("about ")[1].split(" times")[0])
    (louder,) = alone(*sines((0.003 * factor, 1.0)))
    assert max(louder.relative(n) for n in (J, C, K)) == pytest.approx(0.01, rel=0.1)


def test_without_stiffness_the_smallest_that_would_show_is_said() -> None:
    lines = told(*sines((0.1, 1.0)), platform=replace(PAPER, stiffness_nm_rad=0.0))
    assert any("declared as 0; a value below" in line and "cannot be distinguished from 0" in line for line in lines)
    assert not any("NOT determined" in line or "nan" in line for line in lines)


def test_a_free_decay_without_torque_gives_ratios_only() -> None:
    run = decay_run(PAPER, duration_s=5.0)
    lines = of_recorded_campaign(Recording((run,)), PAPER)
    assert any(
        "a decay without torque determines only ratios; expected C/J" in line and "K/J" in line for line in lines
    )
    assert not any("cannot" in line for line in lines)


def test_a_delay_and_an_effect_are_parameters_like_any_other() -> None:
    platform = with_delay(replace(PAPER, effects={"coulomb_friction": {"level": 1.0}}))
    (found,) = alone(*sines((111.0, 3.0)), platform=platform)
    assert found.names[-2:] == (("coulomb_friction", "level"), ("torque_delay", "delay"))
    assert found.relative(("coulomb_friction", "level")) < 0.01
    assert found.without(("torque_delay", "delay")).relative(C) <= found.relative(C)
    assert with_delay(platform) is platform


def test_a_gyro_that_does_not_say_its_noise_is_assumed_to_be_the_papers() -> None:
    assert "0.05 deg/s per sample (assumed" in told(*sines((20.0, 1.0)), noise=None)[0]


def test_two_copies_of_a_parameter_have_rank_one_less_and_no_bound() -> None:
    (found,) = alone(*sines((111.0, 3.0)))
    twice = np.array([0, 1, 2, 2])
    double = replace(
        found, names=(*found.names, ("copy",)), values=found.values[twice],
        matrix=found.matrix[np.ix_(twice, twice)], known=found.known[np.ix_(twice, twice)],
        misfit=found.misfit[np.ix_(twice, twice)],
    )  # fmt: skip
    assert double.rank == 3
    assert math.isinf(double.condition)
    assert math.isinf(double.std_error(K))
    assert double.std_error(J) == pytest.approx(found.std_error(J), rel=1e-3)


def test_a_planned_set_is_played_from_rest_without_noise() -> None:
    (only,) = planned(sines((50.0, 1.0)))
    trace = planned_trace(PAPER, only, 500.0, NOISE_RAD_S)
    assert trace.measured[0] == 0.0
    assert trace.noise == NOISE_RAD_S
    assert trace.step_s == pytest.approx(0.002)
    assert 1990 < information_of(trace, PAPER).count <= 2001


def test_advice_reads_like_a_bench_engineer() -> None:
    assert (
        advice.undetermined_sentence("set 0.5 Hz", ["inertia", "stiffness"], "6 Hz")
        == "set 0.5 Hz alone cannot separate inertia from stiffness: keep the start transient or fit it with 6 Hz"
    )
    assert advice.undetermined_sentence("a", ["damping"]).startswith("a alone does not determine damping")
