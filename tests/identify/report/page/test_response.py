"""The frequency response in the report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.report.page.plots.response import response_figure, set_responses, settle_s
from tests.identify.sample import TRUTH, sample, unhappy

FOUND, RECORDING = sample(6.0)


def test_every_sine_set_gives_a_point_at_its_frequency() -> None:
    sets = set_responses(FOUND, RECORDING)
    hertz = [float(s.measured.frequency_hz[0]) for s in sets]
    assert hertz == pytest.approx([0.5, 1.0, 3.0, 6.0, 9.0], rel=3e-4)


def test_the_final_models_simulation_answers_as_measured_and_the_declared_one_does_not() -> None:
    for one in set_responses(FOUND, RECORDING):
        assert one.before is not None
        assert one.after is not None
        off = [abs(s.response[0] / one.measured.response[0] - 1.0) for s in (one.before, one.after)]
        assert off[1] < 2e-3 < off[0]


def test_measured_declared_and_final_are_drawn_with_gain_phase_deviation_and_coherence() -> None:
    figure = response_figure(FOUND, RECORDING)
    assert figure is not None
    assert {"measured", "declared model", "final model", "final model, all effects"} <= {
        t["name"] for t in figure.traces
    }
    titles = [figure.layout[f"yaxis{n}"]["title"]["text"] for n in ("", "2", "3", "4")]
    assert titles == ["gain (dB)", "phase (deg)", "off by (%)", "coherence"]
    assert "dB re 1 (rad/s)/(N·m)" in str(figure.layout["annotations"])
    assert "Coulomb friction depends on the amplitude" in figure.caption


def test_a_linear_axis_has_its_own_units() -> None:
    figure = response_figure(replace(FOUND, axis="linear"), RECORDING)
    assert figure is not None
    assert "speed over force, dB re 1 (m/s)/N" in str(figure.layout["annotations"])


def test_repeats_of_one_torque_become_one_set() -> None:
    twice = replace(FOUND, traces=(FOUND.traces[2], replace(FOUND.traces[2], name="again")))
    (one,) = set_responses(twice, RECORDING)
    (alone,) = set_responses(replace(FOUND, traces=FOUND.traces[2:3]), RECORDING)
    assert one.measured.averages[0] == 2.0 * alone.measured.averages[0]


def test_a_run_with_many_samples_left_out_is_not_compared_with_a_simulation_in_pieces() -> None:
    pieces = replace(FOUND.traces[2], keep=np.where(np.arange(6001) % 2, 1.0, 0.0))
    (one,) = set_responses(replace(FOUND, traces=(pieces,)), RECORDING)
    assert one.after is None
    assert response_figure(replace(FOUND, traces=(pieces,)), RECORDING) is not None


def test_without_torque_there_is_no_response() -> None:
    assert response_figure(unhappy(), RECORDING) is None


def test_a_model_that_does_not_damp_waits_for_nothing() -> None:
    assert settle_s(replace(TRUTH, damping_nm_s_rad=-0.1)) == 0.0
    assert settle_s(None) == 0.0
    assert settle_s(TRUTH) == pytest.approx(4.0 * 2.0 * 0.0203 / 0.0447)
