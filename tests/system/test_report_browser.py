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

from tests.system.devtools import Browser, axe_script, find_chromium

CHROMIUM = find_chromium()
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed: apt-get install chromium")

PHONE_PX = 390
SHOWN_S = 4.0  # of every run: longer ones only take longer to be drawn
# Pairs of texts of one plot that lie over each other, each as its words.
OVERLAPS = """[...document.querySelectorAll('.plot')].flatMap(plot => {
    const texts = [...plot.querySelectorAll('.annotation-text, .xtitle, .ytitle, .legendtext')]
        .map(e => [e.textContent, e.getBoundingClientRect()]).filter(([, r]) => r.width > 0);
    return texts.flatMap(([a, r], i) => texts.slice(i + 1)
        .filter(([, q]) => Math.min(r.right, q.right) - Math.max(r.left, q.left) > 2
            && Math.min(r.bottom, q.bottom) - Math.max(r.top, q.top) > 3)
        .map(([b]) => `${plot.id}: ${a} over ${b}`));
})"""
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
    browser = opened(tmp_path_factory.mktemp("report"), report_html(*sample(SHOWN_S), "default"))
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
    page.evaluate("document.querySelectorAll('details').forEach(fold => { fold.open = true })")
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


@pytest.fixture(scope="module")
def phones(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Browser, str]]:
    """A browser for one page after the other, and where the report is."""
    folder = tmp_path_factory.mktemp("phone")
    (folder / "report.html").write_text(report_html(*sample(SHOWN_S), "default"), encoding="utf-8")
    assert CHROMIUM
    browser = Browser(CHROMIUM, folder / "profile")
    yield browser, (folder / "report.html").as_uri()
    browser.close()


@pytest.fixture(scope="module", params=["light", "dark"])
def phone(request: pytest.FixtureRequest, phones: tuple[Browser, str]) -> Iterator[Browser]:
    """The report in a window of 390 px, all folds open."""
    browser, page = phones
    scheme = [{"name": "prefers-color-scheme", "value": request.param}]
    browser.open(page, width_px=PHONE_PX, features=scheme)
    browser.wait_for("document.documentElement.dataset.drawn")
    browser.evaluate("document.querySelectorAll('details').forEach(fold => { fold.open = true })")
    yield browser
    browser.leave()


def test_on_a_phone_nothing_is_wider_and_tables_scroll_in_their_own_place(phone: Browser) -> None:
    assert phone.evaluate("document.documentElement.scrollWidth") == PHONE_PX
    wide = "[...document.querySelectorAll('.scroll')].filter(e => e.scrollWidth > e.clientWidth)"
    assert phone.evaluate(f"{wide}.length") > 0, "a table that scrolls is what this is about"
    assert phone.evaluate(f"{wide}.every(e => e.tabIndex === 0 && getComputedStyle(e).overflowX === 'auto')")
    captions = "[...document.querySelectorAll('caption span')].map(e => e.getBoundingClientRect().width)"
    assert max(phone.evaluate(captions)) <= PHONE_PX


def test_on_a_phone_panels_stand_one_above_the_other_and_titles_do_not_overlap(phone: Browser) -> None:
    phone.evaluate("new Promise(done => setTimeout(done, 500))")  # folds that opened are drawn anew
    assert phone.evaluate(OVERLAPS) == []


def test_the_first_screen_of_a_desktop_has_sentences_errors_and_the_plot(report: Browser) -> None:
    bottom = "document.querySelector('#found .plot').getBoundingClientRect().bottom + window.scrollY"
    assert report.evaluate(bottom) < 900
    assert report.evaluate("document.querySelectorAll('#found .sentences p').length") == 3


def test_axe_finds_nothing_serious(page: Browser) -> None:
    found = []
    page.evaluate(f"{axe_script()}; 0")
    # Light and dark differ in nothing but their colours.
    for scheme, rules in (("light", ""), ("dark", ", runOnly: ['color-contrast']")):
        page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        found += page.evaluate(f"axe.run(document, {{resultTypes: ['violations']{rules}}}).then(r => r.violations.map("
                               "v => [v.impact, v.id, v.nodes.length, v.nodes[0].html.slice(0, 200)]))")  # fmt: skip
    assert [v for v in found if v[0] in ("serious", "critical")] == []
