"""The documentation as a site, in a real browser: readable and named for a screen reader, in light and in dark."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

if sys.platform == "win32":
    pytest.skip("the DevTools pipe needs POSIX file descriptors", allow_module_level=True)

from tests.system.devtools import Browser, axe_script, find_chromium

ROOT = Path(__file__).parents[2]
CHROMIUM = find_chromium()
BUILT_WITHIN_S = 120.0
DESKTOP_PX = 1280
# Light and dark differ in nothing but their colours.
RULES = {"light": "", "dark": ", runOnly: ['color-contrast']"}
SERIOUS = """axe.run(document, {resultTypes: ['violations']%s}).then(found => found.violations
    .filter(v => ['serious', 'critical'].includes(v.impact))
    .map(v => [v.id, v.nodes.length, v.nodes[0].html.slice(0, 120)]))"""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed: apt-get install chromium"),
]


class Quiet(SimpleHTTPRequestHandler):
    """Serves files and says nothing."""

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built as .ci/run builds it."""
    pytest.importorskip("mkdocs", reason="pip install -e '.[docs]'")
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", folder], check=False, cwd=ROOT,
        capture_output=True, text=True, timeout=BUILT_WITHIN_S, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    """Where the site is served: scripts of the theme and the page of what is not found need a server."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(site)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize("scheme", RULES)
def test_axe_finds_nothing_serious_on_any_page(scheme: str, site: Path, address: str, tmp_path: Path) -> None:
    pages = sorted(path.relative_to(site).as_posix() for path in site.rglob("*.html"))
    assert "404.html" in pages and "index.html" in pages
    assert CHROMIUM
    browser, found = Browser(CHROMIUM, tmp_path / "profile"), {}
    try:
        for page in pages:
            browser.leave()
            browser.open(f"{address}/{page}", DESKTOP_PX, [{"name": "prefers-color-scheme", "value": scheme}])
            browser.evaluate(f"{axe_script()}; 0")
            if serious := browser.evaluate(SERIOUS % RULES[scheme]):
                found[page] = serious
    finally:
        browser.close()
    assert found == {}
