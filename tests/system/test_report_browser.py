"""report.html in a real browser: drawn, silent, and closed to the network."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from identify.report.page import report_html
from tests.identify.sample import sample, unhappy

if sys.platform == "win32":
    pytest.skip("the DevTools pipe needs POSIX file descriptors", allow_module_level=True)

from tests.system.devtools import Browser, find_chromium

CHROMIUM = find_chromium()
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed: apt-get install chromium")

DRAWN_PATHS = """[...document.querySelectorAll('.plot')].map(plot => ({
    id: plot.id,
    surfaces: plot.querySelectorAll('.main-svg').length,
    wanted: plot.data.filter(t => t.visible !== 'legendonly').length,
    drawn: [...plot.querySelectorAll('.scatterlayer .trace')].filter(
        t => [...t.querySelectorAll('path')].some(p => (p.getAttribute('d') || '').length > 4)).length,
    height: plot.getBoundingClientRect().height,
}))"""


def opened(folder: Path, page: str) -> Browser:
    """The page in a browser of its own, all plots drawn."""
    (folder / "report.html").write_text(page, encoding="utf-8")
    assert CHROMIUM
    browser = Browser(CHROMIUM, folder / "profile")
    try:
        browser.open((folder / "report.html").as_uri())
        browser.wait_for("document.documentElement.dataset.drawn")
    except BaseException:
        browser.close()
        raise
    return browser


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """The report of an accepted campaign."""
    browser = opened(tmp_path_factory.mktemp("report"), report_html(*sample(), "default"))
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """The report of an aborted one with little in it, and names that are HTML."""
    page = report_html(unhappy(), sample(2.0)[1], "</title><script>document.title = 'owned'</script>")
    browser = opened(tmp_path_factory.mktemp("hostile"), page)
    yield browser
    browser.close()


@pytest.fixture(params=["report", "hostile"])
def page(request: pytest.FixtureRequest) -> Browser:
    """Either of the two."""
    browser: Browser = request.getfixturevalue(request.param)
    return browser


def test_the_console_stays_silent(page: Browser) -> None:
    assert page.of_kind("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded") == []


def test_no_request_leaves_the_page(page: Browser) -> None:
    asked = [event["request"]["url"] for event in page.of_kind("Network.requestWillBeSent")]
    assert asked, "at least the page itself was asked for"
    assert [url for url in asked[1:] if not url.startswith(("data:", "blob:"))] == []


def test_every_plot_is_drawn_with_every_trace(page: Browser) -> None:
    plots = page.evaluate(DRAWN_PATHS)
    assert len(plots) == int(page.evaluate("document.documentElement.dataset.drawn"))
    for plot in plots:
        assert plot["surfaces"] > 0, plot
        assert plot["drawn"] == plot["wanted"] > 0, plot
        assert plot["height"] > 100, plot


def test_an_accepted_campaign_shows_parameters_residual_convergence_and_every_run(report: Browser) -> None:
    labels = report.evaluate("[...document.querySelectorAll('.plot')].map(p => p.getAttribute('aria-label'))")
    for words in ("Parameters", "against time", "against angle", "against rate", "against frequency", "Genetic"):
        assert any(words in label for label in labels), words
    assert sum(label.startswith("Run ") for label in labels) == 5


def test_a_zoom_button_shows_the_start_transient_in_all_panels(report: Browser) -> None:
    report.evaluate("document.querySelector('button[data-range=\"[0.0, 1.0]\"]').click()")
    key = report.evaluate("document.querySelector('button[data-range=\"[0.0, 1.0]\"]').dataset.figure")
    shown = report.wait_for(f"document.getElementById('{key}').layout.xaxis3.range")
    assert shown == [0.0, 1.0]


@pytest.mark.parametrize(("scheme", "bright"), [("light", False), ("dark", True)])
def test_plots_and_text_follow_light_and_dark(report: Browser, scheme: str, bright: bool) -> None:
    report.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    fill = "getComputedStyle(document.querySelector('.main-svg .xtick text')).fill"
    red = int(report.evaluate(fill).removeprefix("rgb(").split(",")[0])
    assert (red > 128) is bright


def test_names_from_outside_are_text_and_nothing_else(hostile: Browser) -> None:
    assert "owned" not in hostile.evaluate("document.title").split("'")[0]
    assert hostile.evaluate("document.title").startswith("</title>")
    assert hostile.evaluate("document.querySelectorAll('h3 b, svg a, svg b, figure script').length") == 0


def test_nothing_is_wider_than_the_window(page: Browser) -> None:
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
