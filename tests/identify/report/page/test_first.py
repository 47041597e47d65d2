"""The first screen of the report: the plot that convinces."""

from __future__ import annotations

import base64
from dataclasses import replace

import numpy as np

from identify.report.page import report_html
from identify.report.page.first import convincing_figure
from identify.report.page.plots.figure import Trace
from tests.identify.sample import sample, unhappy

FOUND, RECORDING = sample(2.0)


def values(trace: Trace, axis: str) -> np.ndarray:
    """What plotly will read."""
    return np.frombuffer(base64.b64decode(trace[axis]["bdata"]), dtype="<f4").astype(float)


def test_the_plot_shows_the_moment_at_which_the_models_differ_most() -> None:
    changed = []
    for t in FOUND.traces:
        off = np.where((t.time_s > 1.2) & (t.time_s < 1.5) & (t.name == "6 Hz"), 3.0, 0.0)
        changed.append(replace(t, simulated_before=t.simulated_after + off * np.max(np.abs(t.measured))))
    figure = convincing_figure(replace(FOUND, traces=tuple(changed)))
    assert figure is not None and "6 Hz" in figure.label
    time = values(figure.traces[0], "x")
    assert time[0] < 1.5 and time[-1] > 1.2
    assert time[-1] - time[0] < 0.75


def test_where_nothing_moved_the_plot_has_a_range_and_a_small_difference_convinces_nobody() -> None:
    """Eight seconds of rest ahead of a chirp: a low-pass leaves next to nothing of the torque there."""
    changed = []
    for t in FOUND.traces:
        rest, size = t.time_s < 1.0, np.max(np.abs(t.measured))
        off = np.where(rest, 0.05, 0.3) * size
        measured = np.where(rest, 1e-300, t.measured)
        changed.append(replace(t, measured=measured, simulated_before=t.simulated_after + off))
    figure = convincing_figure(replace(FOUND, traces=tuple(changed)))
    assert figure is not None
    assert values(figure.traces[0], "x")[0] > 0.9
    peak = max(float(np.max(np.abs(t.measured))) for t in changed)
    resting = [
        replace(t, simulated_before=t.simulated_after + np.where(t.time_s < 1.0, 5.0 * peak, 0.0)) for t in changed
    ]
    figure = convincing_figure(replace(FOUND, traces=tuple(resting)))
    assert figure is not None
    shown = next(values(t, "y") for t in figure.traces if t["name"] == "measured")
    assert np.max(np.abs(shown)) < 1e-6 * peak  # here the rest convinces, and nothing was measured
    assert figure.layout["yaxis"]["range"][1] > 0.01 * peak


def test_measured_lies_beside_both_models_and_their_errors() -> None:
    figure = convincing_figure(FOUND)
    assert figure is not None
    named = {(t["name"], t["yaxis"]) for t in figure.traces}
    models = {(m, y) for m in ("declared model", "final model") for y in ("y", "y2")}
    assert named == {("measured", "y")} | models


def test_a_simulation_that_runs_away_does_not_shrink_the_measured_motion() -> None:
    away = tuple(replace(t, simulated_before=1e9 * np.ones(len(t.time_s))) for t in FOUND.traces)
    figure = convincing_figure(replace(FOUND, traces=away))
    assert figure is not None
    low, high = figure.layout["yaxis"]["range"]
    assert high == -low < 3.0 * max(np.max(np.abs(t.measured)) for t in FOUND.traces)


def test_where_the_torque_decided_the_torque_is_shown() -> None:
    assert FOUND.after is not None
    error = replace(FOUND.after.error, holdout_measure="holdout_torque_relative", holdout_torque_relative=0.02)
    figure = convincing_figure(replace(FOUND, after=replace(FOUND.after, error=error)))
    assert figure is not None and figure.label.startswith("Measured torque")


def test_the_genetic_algorithm_and_the_bounds_are_folded_away() -> None:
    page = report_html(FOUND, RECORDING, "x")
    for words in ("Genetic algorithm", "Cramer-Rao bound and standard error reached"):
        assert f"<details><summary>{words}</summary>" in page


def test_without_runs_there_is_no_plot_and_the_page_is_made_all_the_same() -> None:
    assert convincing_figure(replace(unhappy(), traces=())) is None
    assert "What was found" in report_html(replace(unhappy(), traces=()), RECORDING, "x")


def test_the_ends_of_a_run_where_the_low_pass_has_not_settled_are_no_error() -> None:
    assert FOUND.after is not None
    error = replace(
        FOUND.after.error, holdout_measure="holdout_torque_relative", holdout_torque_relative=0.02, lowpass_hz=20.0
    )
    edge = []
    for t in FOUND.traces:
        assert t.torque_nm is not None and t.torque_residual_after is not None
        late = np.where(t.time_s > t.time_s[-1] - 0.02, 0.9 * np.max(np.abs(t.torque_nm)), 0.0)
        edge.append(replace(t, torque_residual_before=t.torque_residual_after + late))
    figure = convincing_figure(replace(FOUND, after=replace(FOUND.after, error=error), traces=tuple(edge)))
    assert figure is not None
    shown = next(values(t, "y") for t in figure.traces if (t["name"], t["yaxis"]) == ("declared model", "y2"))
    assert np.nanmax(np.abs(shown)) < 1.0  # N m
