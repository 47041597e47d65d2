"""A hook of mkdocs: links from a page to files outside of docs/ (source code, README) become plain words on the site.

In the tree they lead somewhere, which tests/system/test_docs.py checks; on the site there is nothing to lead to.
"""

from __future__ import annotations

import posixpath
import re
from typing import Any

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((\.\./[^)\s]*)\)")


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The page's text with those links taken out."""
    folder = posixpath.dirname(page.file.src_uri)

    def words(link: re.Match[str]) -> str:
        outside = posixpath.normpath(posixpath.join(folder, link[2])).startswith("..")
        return link[1] if outside else link[0]

    return LINK.sub(words, markdown)
