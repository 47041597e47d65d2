"""The HTML document around the sections: places for figures, their data, styles and scripts, and nothing fetched."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from itertools import count
from typing import Any

from plotly.offline import get_plotlyjs

from identify.report.json_values import finite
from identify.report.page.markup import Markup, element
from identify.report.page.plots.figure import Figure

# Nothing may be fetched and nothing sent: the browser itself holds the page to it.
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"


class Gallery:
    """Hands out places for figures and remembers what is to be drawn there."""

    def __init__(self) -> None:
        self.figures: dict[str, dict[str, Any]] = {}
        self._numbers = count(1)

    def place(self, figure: Figure | None) -> Markup:
        """Where the figure will stand; nothing for None."""
        if figure is None:
            return Markup("")
        key = f"figure-{next(self._numbers)}"
        self.figures[key] = {"data": list(figure.traces), "layout": figure.layout | {"height": figure.height}}
        buttons = [
            element("button", text, type="button", data_figure=key, data_range=json.dumps(span))
            for text, span in figure.zooms
        ]
        plot = element(
            "div",
            class_="plot",
            id=key,
            role="group",  # and no img: its buttons have to be reached
            aria_label=figure.label,
            style=f"height:{figure.height}px",
        )
        heading = element("h3", figure.heading) if figure.heading else Markup("")
        zooms = element("div", *buttons, class_="zooms") if buttons else Markup("")
        return element("figure", heading, zooms, plot, element("figcaption", figure.caption))


def embedded(value: Any) -> str:
    """JSON that may stand inside a script element: no character of it can end the element."""
    text = json.dumps(finite(value), allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def document(title: str, body: Markup, figures: Mapping[str, Any]) -> str:
    """The whole file: the sections in it, the figures as data, plotly and this package's style and script."""
    own = files("identify.report.page")
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            '<link rel="icon" href="data:,">',
            element("title", title).html,
            f"<style>{(own / 'page.css').read_text(encoding='utf-8')}</style></head>",
            f"<body><main>{body.html}</main>",
            "<noscript><p>The plots need JavaScript, which this page carries; text and tables do not.</p></noscript>",
            f'<script type="application/json" id="figures">{embedded(figures)}</script>',
            f"<script>{get_plotlyjs()}</script>",
            f"<script>{(own / 'page.js').read_text(encoding='utf-8')}</script>",
            "</body></html>",
            "",
        ]
    )
