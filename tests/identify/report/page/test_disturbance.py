"""What is left as a torque: the table, the shapes, and the spectrum with the band of noise."""

from __future__ import annotations

import base64
from dataclasses import replace

import numpy as np
import pytest

from identify.report.page.plots.disturbance import disturbance_table, shape_figure
from identify.report.page.plots.figure import Trace
from identify.report.page.plots.spectrum import noise_band, spectrum, spectrum_figures, torque_per_reading
from identify.residual import Dependence, Disturbance
from identify.results import Identification
from rig.arrays import Array
from rig.platform import Platform
from tests.identify.sample import SIGMA, TRUTH, sample

AT = tuple(np.linspace(-1.0, 1.0, 25).tolist())
ANGLE = Dependence("angle", 0.02, 0.04, 1e-9, AT, tuple(0.03 * x**3 for x in AT))
DIRECTION = Dependence("direction", 0.01, 0.02, 1e-6, (-1.0, 1.0), (-0.01, 0.01))
HISTORY = Dependence("history", 0.01, 0.02, 1e-6)


@pytest.fixture(scope="module")
def found() -> Identification:
    whole = sample(2.0)[0]
    return replace(whole, disturbance=Disturbance(0.03, "N*m", 0.06, (ANGLE, DIRECTION, HISTORY)))


def read(trace: Trace, key: str) -> Array:
    return np.frombuffer(base64.b64decode(trace[key]["bdata"]), dtype="<f4").astype(float)


def test_the_table_says_how_large_it_is_and_what_it_depends_on(found: Identification) -> None:
    html = disturbance_table(found).html
    for words in ("0.030", "depends on the angle", "depends on the past motion", "4.0"):
        assert words in html
    assert "depends on the position" in disturbance_table(replace(found, axis="linear")).html


def test_without_a_torque_there_is_no_table_and_without_a_dependence_no_shape(found: Identification) -> None:
    assert not disturbance_table(replace(found, disturbance=None)).html
    assert shape_figure(replace(found, disturbance=None)) is None
    assert shape_figure(replace(found, disturbance=Disturbance(0.03, "N*m", 0.06))) is None


def test_each_term_that_has_a_shape_is_drawn_against_what_it_depends_on(found: Identification) -> None:
    figure = shape_figure(found)
    assert figure is not None
    curve, ends = figure.traces
    np.testing.assert_allclose(read(curve, "y"), ANGLE.shape_nm, rtol=1e-6)
    assert ends["mode"] == "markers"
    assert figure.layout["xaxis2"]["ticktext"] == ["backward", "forward"]


def test_noise_of_the_sensor_alone_lies_in_the_band_of_the_torque_spectrum() -> None:
    whole, platform = sample(10.0)[0], Platform(TRUTH.inertia_kg_m2, 0.0, 0.0)
    assert whole.after is not None
    rng, traces = np.random.default_rng(3), []
    for trace in whole.traces:
        noise = SIGMA * rng.standard_normal(len(trace.time_s))
        traces.append(replace(trace, torque_residual_after=platform.inertia_kg_m2 * np.gradient(noise, 1e-3)))
    pure = replace(whole, traces=tuple(traces), after=replace(whole.after, platform=platform))
    hertz, density = spectrum(pure.traces, "after", torque=True)
    low, high = noise_band(pure, hertz)
    here = (hertz > 2.0) & (hertz < 40.0)  # where a difference of neighbours is the derivative
    inside = (np.sqrt(density) > low) & (np.sqrt(density) < high)
    assert np.mean(inside[here]) == pytest.approx(0.95, abs=0.06)


def test_torque_for_a_reading_is_that_of_inertia_damping_and_stiffness() -> None:
    hertz = np.array([1.0, 5.0])
    w = 2.0 * np.pi * hertz
    angle = torque_per_reading(TRUTH, hertz, "angle")
    expected = TRUTH.stiffness_nm_rad - TRUTH.inertia_kg_m2 * w**2 + 1j * w * TRUTH.damping_nm_s_rad
    np.testing.assert_allclose(angle, expected)
    np.testing.assert_allclose(torque_per_reading(TRUTH, hertz, "rate") * 1j * w, expected)


def test_without_a_torque_only_the_motion_has_a_spectrum(found: Identification) -> None:
    bare = tuple(replace(t, torque_residual_before=None, torque_residual_after=None) for t in found.traces)
    assert len(spectrum_figures(replace(found, traces=bare))) == 1
    assert "N·m" in spectrum_figures(found)[0].layout["yaxis"]["title"]["text"]
