"""The few HTML pieces the report is made of; whatever comes from outside is escaped here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from identify.wording import unbroken


@dataclass(frozen=True)
class Markup:
    """HTML that is safe to place as it stands; a plain string never is."""

    html: str


Piece = str | Markup


def text(piece: Piece) -> str:
    """HTML of a piece: markup as it is, a string escaped and without what would turn the text around it."""
    if isinstance(piece, Markup):
        return piece.html
    return escape("".join(c if c.isprintable() or c.isspace() else "?" for c in piece))


def join(pieces: Iterable[Piece]) -> Markup:
    """Several pieces, one after the other."""
    return Markup("".join(text(piece) for piece in pieces))


def element(tag: str, *content: Piece, **attributes: str) -> Markup:
    """``<tag ...>content</tag>``; ``class_`` stands for class, ``aria_label`` for aria-label."""
    given = "".join(f' {k.rstrip("_").replace("_", "-")}="{escape(v)}"' for k, v in attributes.items())
    return Markup(f"<{tag}{given}>{join(content).html}</{tag}>")


def paragraph(*content: Piece, class_: str = "") -> Markup:
    """A paragraph."""
    return element("p", *content, class_=class_) if class_ else element("p", *content)


def bullets(lines: Sequence[Piece]) -> Markup:
    """A list, or nothing where there is nothing to list."""
    return element("ul", *[element("li", line) for line in lines]) if lines else Markup("")


def words(sentence: str) -> Markup:
    """A sentence with its numbers beside their units, and what stands between backticks as code."""
    parts = unbroken(sentence).split("`")
    if len(parts) % 2 == 0:  # a backtick that is never closed
        return join(["`".join(parts)])
    return join(element("code", part) if i % 2 else part for i, part in enumerate(parts))


def section(anchor: str, heading: str, *content: Piece) -> Markup:
    """A section with its heading."""
    return element("section", element("h2", heading), *content, id=anchor)


def folded(summary: str, *content: Piece) -> Markup:
    """What opens on a click; printing opens it too."""
    return element("details", element("summary", summary), *content)


def table(head: Sequence[Piece], rows: Sequence[Sequence[Piece]], caption: str, words: Sequence[int] = ()) -> Markup:
    """A table of numbers; the first cell of a row names it, columns in ``words`` hold text."""
    header = element("tr", *[element("th", cell, scope="col", **_number(i, words)) for i, cell in enumerate(head)])
    body = [
        element(
            "tr",
            element("th", row[0], scope="row"),
            *[element("td", cell, **_number(i, words)) for i, cell in enumerate(row[1:], 1)],
        )
        for row in rows
    ]
    said = element("caption", element("span", caption))
    inner = element("table", said, element("thead", header), element("tbody", *body))
    # Reached by the keyboard, or nobody without a mouse sees the columns to the right.
    return element("div", inner, class_="scroll", tabindex="0", role="region", aria_label=_short(caption))


def _short(caption: str) -> str:
    """Its first sentence."""
    return f"Table: {caption.partition('. ')[0].rstrip('.')}"


def _number(column: int, words: Sequence[int]) -> dict[str, str]:
    return {"class_": "words" if column in words else "number"} if column else {}
