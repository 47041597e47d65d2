"""report.html as text: self-contained, safe, complete."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from plotly.offline import get_plotlyjs

from identify.report.page import report_html
from identify.report.page.document import embedded
from identify.report.page.markup import Markup, element, table, words
from identify.report.page.plots.convergence import convergence_figure
from identify.report.page.plots.estimates import estimates_figure
from identify.report.page.plots.motion import MAX_RUNS_DRAWN, motion_figures, stretches
from identify.report.page.plots.residual import residual_figures
from identify.report.page.plots.spectrum import spectrum, spectrum_figures
from identify.report.page.tables import candidate_table, parameter_table
from identify.residual import FreeLine
from identify.results import Candidate, Identification, NotReported
from identify.wording import MAX_DIGITS
from rig.recording.run import Array
from tests.identify.sample import SIGMA, sample, unhappy


@pytest.fixture(scope="module")
def found() -> Identification:
    return sample(2.0)[0]


@pytest.fixture(scope="module")
def page() -> str:
    return report_html(*sample(2.0), "default").replace(get_plotlyjs(), "")


def numbers(packed: dict[str, str]) -> Array:
    """What plotly will read."""
    return np.frombuffer(base64.b64decode(packed["bdata"]), dtype="<f4").astype(float)


def test_nothing_is_loaded_from_elsewhere(page: str) -> None:
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert "https://" not in page
    assert "http://" not in page
    assert "default-src 'none'" in page


def test_the_library_is_inlined_once() -> None:
    assert report_html(*sample(2.0), "default").count(get_plotlyjs()) == 1


def test_its_own_data_stay_small(page: str) -> None:
    assert len(page) < 2_000_000


def test_the_verdict_in_words_stands_before_everything_else(page: str) -> None:
    assert page.index("Coulomb friction is missing: 1.1998\u00a0N·m") < page.index("<table")
    assert "ACCEPTED" in page


def test_no_number_has_more_digits_than_an_interval_supports(page: str) -> None:
    body = page[page.index("<body") :].partition('id="origin"')[0]
    visible = re.sub(r"<(script|style).*?</\1>|<[^>]*>", " ", body, flags=re.DOTALL)
    digits = [n.replace(".", "").lstrip("0") for n in re.findall(r"(?<![\w.])\d[\d.]*", visible)]
    assert max(len(n) for n in digits) == MAX_DIGITS


def test_a_campaign_that_is_not_accepted_says_why_and_what_next() -> None:
    told = report_html(replace(unhappy(), aborted=False), sample(2.0)[1], "x")
    assert "NOT ACCEPTED" in told
    assert "Why it was not accepted" in told
    assert "its interval spans zero" in told


def test_an_accepted_campaign_with_something_left_open_says_what_next_and_nothing_of_a_refusal() -> None:
    found, recording = sample(2.0)
    told = report_html(replace(found, verdict=replace(found.verdict, tells_apart="Add a known mass.")), recording, "x")
    assert "Add a known mass." in told
    assert "Why it was not accepted" not in told


def test_names_from_outside_never_become_markup() -> None:
    told = report_html(unhappy(), sample(2.0)[1], "<i>x</i>").replace(get_plotlyjs(), "")
    assert 'document.title="owned"</script>' not in told
    assert "<i>x</i>" not in told
    assert "&lt;i&gt;x&lt;/i&gt;" in told


def test_embedded_json_cannot_end_its_element_and_reads_back_the_same() -> None:
    value = {"name": "</script><!-- & \u2028", "x": [1.0, float("nan")]}
    text = embedded(value)
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"name": value["name"], "x": [1.0, None]}


def test_markup_escapes_strings_and_leaves_markup() -> None:
    assert element("p", "a < b", Markup("<b>c</b>"), title='"').html == '<p title="&quot;">a &lt; b<b>c</b></p>'
    assert '<td class="words">x</td>' in table(["", "a"], [["row", "x"]], "caption", words=(1,)).html


def test_every_run_is_drawn_with_all_its_peaks(found: Identification) -> None:
    figures = motion_figures(found)
    assert [figure.heading for figure in figures] == [trace.name for trace in found.traces]
    measured = next(t for t in figures[2].traces if t["name"] == "measured")
    assert numbers(measured["y"]).max() == pytest.approx(found.traces[2].measured.max(), rel=1e-6)


def test_of_very_many_runs_the_worst_are_drawn_in_the_order_they_were_played(found: Identification) -> None:
    good = found.traces[0]
    bad = replace(good, name="bad", simulated_after=good.simulated_after + 1.0)
    figures = motion_figures(replace(found, traces=(*[good] * 20, bad, *[good] * 5)))
    assert len(figures) == MAX_RUNS_DRAWN
    assert "bad" in [figure.heading for figure in figures]


def test_samples_that_do_not_count_are_gaps_in_the_error(found: Identification) -> None:
    half = np.where(np.arange(len(found.traces[0].time_s)) < 1000, 0.0, 1.0)
    figure = motion_figures(replace(found, traces=(replace(found.traces[0], keep=half),)))[0]
    error = next(t for t in figure.traces if t["name"] == "error, final model")
    x, y = numbers(error["x"]), numbers(error["y"])
    assert np.isnan(y[x < 0.999]).all()
    assert np.isfinite(y[x > 1.001]).all()


def test_held_out_stretches_are_found(found: Identification) -> None:
    assert stretches(np.arange(6.0), np.array([1.0, 1, 0, 0, 1, 0])) == [(0.0, 1.0), (4.0, 4.0)]
    assert stretches(np.arange(400.0), np.tile([0.0, 1.0], 200)) == []


def test_the_spectrum_of_white_noise_lies_on_the_floor_line(found: Identification) -> None:
    hertz, density = spectrum(found.traces, "after")
    assert hertz[-1] == pytest.approx(500.0, rel=1e-3)
    assert np.mean(density) == pytest.approx(2.0 * SIGMA**2 * 1e-3, rel=0.1)


def test_the_spectrum_makes_up_for_samples_that_do_not_count(found: Identification) -> None:
    keep = np.where(np.arange(2001) % 4 == 0, 0.0, 1.0)
    _, density = spectrum([replace(trace, keep=keep) for trace in found.traces], "after")
    assert np.mean(density) == pytest.approx(2.0 * SIGMA**2 * 1e-3, rel=0.1)


def test_declared_numbers_stand_in_a_column_of_their_own(found: Identification) -> None:
    beside = parameter_table(replace(found, declared={"stiffness": 677.3, "coulomb_friction.level": 1.5})).html
    assert ">declared value</th>" in beside
    assert ">677.3<" in beside
    assert ">1.5<" in beside
    assert ">declared value</th>" not in parameter_table(found).html


def test_residuals_are_drawn_against_time_angle_rate_and_frequency(found: Identification) -> None:
    assert len(residual_figures(found)) == 4
    assert len(spectrum_figures(found)) == 2
    nothing = replace(found, traces=())
    assert residual_figures(nothing) == spectrum_figures(nothing) == []


def test_the_page_says_where_the_residual_of_either_model_lives(page: str) -> None:
    before, after = (
        page.index("What the residual contains: declared model"),
        page.index("What the residual contains: final model"),
    )
    assert before < page.index("in odd harmonics (3rd") < after
    assert before < page.index("changes sign with the direction of motion") < after
    assert after < page.index("and shows no structure")


def test_a_gap_between_the_two_directions_of_motion_is_drawn(found: Identification) -> None:
    figure = residual_figures(found)[2]
    means = {t["name"]: numbers(t["y"]) for t in figure.traces if t["name"].startswith("mean") and t["yaxis"] == "y"}
    assert np.median(means["mean, forward"]) > 0.5 and np.median(means["mean, backward"]) < -0.5


def test_harmonics_and_free_lines_are_marked_in_the_spectrum(found: Identification) -> None:
    assert found.residual_before is not None
    pump = replace(found.residual_before, free_lines=(FreeLine(17.3, 0.1, 5),))
    figure = spectrum_figures(replace(found, residual_before=pump))[-1]
    odd = next(t for t in figure.traces if t["name"] == "odd harmonics")
    assert {1.5, 9.0, 27.0} <= set(np.round(numbers(odd["x"]), 3).tolist())
    assert not any(t["name"] == "even harmonics" for t in figure.traces)
    assert "17.3 Hz, free" in [note["text"] for note in figure.layout["annotations"]]
    assert any(shape.get("x0") == 17.3 for shape in figure.layout["shapes"])


def test_without_torque_the_error_of_the_motion_takes_its_place() -> None:
    first = residual_figures(unhappy())[0]
    assert first.layout["yaxis"]["title"]["text"] == "error (m)"


def test_convergence_is_drawn_for_all_sets_and_each(found: Identification) -> None:
    figure = convergence_figure(found)
    assert figure is not None
    assert {t["name"] for t in figure.traces} == {"all sets", *[one.name for one in found.per_set]}
    assert convergence_figure(unhappy()) is None


def test_an_estimate_far_outside_is_named_instead_of_drawn(found: Identification) -> None:
    figure = estimates_figure(found)
    assert figure is not None
    notes = [note["text"] for note in figure.layout["annotations"]]
    assert "+822 % →" in notes
    assert "not determined" in notes


@pytest.mark.parametrize("change", [{"after": None}, {"per_set": ()}, {"joint": None}, {"traces": ()}])
def test_it_is_written_whatever_is_missing(found: Identification, change: dict[str, Any]) -> None:
    told = report_html(replace(found, **change), sample(2.0)[1], "default")
    assert told.rstrip().endswith("</html>")


def test_an_effect_is_explained_with_its_equation_and_source(page: str) -> None:
    assert "T = level * sgn(w)" in page


def test_a_candidate_that_explains_more_than_the_effect_that_was_added_says_why_it_was_not() -> None:
    tried = (
        Candidate("stribeck_friction", 1, -16222.04, None, "no better"),
        Candidate("coulomb_friction", 1, -13075.2, None, "added"),
        Candidate("sensor_lag", 1, -246.1, None, "no better"),
    )
    rows = candidate_table(tried, 1.0).html.split("<tr>")
    said = {name: row for row in rows for name in ("Stribeck", "Coulomb", "sensor lag") if name in row}
    assert "a simpler effect was added instead" in said["Stribeck"]
    assert "-16222<" in said["Stribeck"]
    assert "less likely than the one added" in said["sensor lag"]


def test_what_stands_between_backticks_is_code_and_nothing_else_is() -> None:
    assert words("Run `rig check` for <b>2 ms</b>.").html == (
        "Run <code>rig check</code> for &lt;b&gt;2\u00a0ms&lt;/b&gt;."
    )
    assert words("an odd ` one").html == "an odd ` one"


def test_a_parameter_that_is_not_determined_has_its_row(found: Identification) -> None:
    lost = NotReported("damping", "its standard error is too large")
    kept = {k: v for k, v in found.before.parameters.items() if k != "damping"}
    one = replace(found, after=None, before=replace(found.before, parameters=kept, not_determined=(lost,)))
    row = next(row for row in parameter_table(one).html.split("<tr>") if "damping C" in row)
    assert "not determined" in row
