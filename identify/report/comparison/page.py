"""A comparison as one HTML file that opens without a network."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files

from identify.report.comparison.section import Section
from identify.report.page.markup import Markup, bullets, element, join, section, table

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def comparison_html(sections: Sequence[Section], names: tuple[str, str]) -> str:
    """The whole page; ``names`` are those of the folders."""
    css = (files("identify.report.page") / "page.css").read_text(encoding="utf-8")
    title = f"{names[0]} and {names[1]}"
    header = element("header", element("p", "Two identifications side by side", class_="kicker"), element("h1", title))
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            '<link rel="icon" href="data:,">',
            element("title", title).html,
            f"<style>{css}</style></head>",
            f"<body><main>{join([header, *(_section(n, one) for n, one in enumerate(sections))]).html}</main></body>",
            "</html>",
            "",
        ]
    )


def _section(number: int, one: Section) -> Markup:
    drawn = [table(one.head, one.rows, "", words=one.words)] if one.rows else []
    return section(f"section-{number}", one.title, *drawn, bullets(one.notes))
