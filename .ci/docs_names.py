"""A hook of mkdocs: what a screen reader has no name for on the site gets one. The theme leaves the search without."""

from __future__ import annotations

from typing import Any

SEARCH = '<div class="md-search" data-md-component="search" role="dialog"'


def on_post_page(output: str, **_: Any) -> str:
    """The page with the names."""
    return output.replace(SEARCH, f'{SEARCH} aria-label="Search"')


def on_post_template(output_content: str, **_: Any) -> str:
    """The same for pages that are made of no text, as 404.html."""
    return on_post_page(output_content)
