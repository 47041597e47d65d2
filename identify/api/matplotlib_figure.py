"""A figure of the report, which is plotly's format as plain values, drawn by matplotlib."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from html import unescape
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.report.page.plots.figure import Figure, Trace
from rig.arrays import Array
from rig.errors import MissingPackage

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as MatplotlibFigure

WIDTH_IN, PER_IN = 9.0, 96.0  # inches wide, and the report's pixels to an inch of height
LEFT, LEFT_OF_NAMES, RIGHT, BOTTOM_IN, TOP_IN = 0.1, 0.19, 0.97, 0.95, 0.4  # of the area that the panels share
POINTS_PER_PIXEL = 0.75  # a pixel in points
STYLES = {"solid": "-", "dash": "--", "dot": ":", "dashdot": "-."}
MARKERS = {"circle-open": "o", "triangle-up": "^", "square": "s", "x-thin-open": "x"}
_RGBA = re.compile(r"rgba\((\d+),(\d+),(\d+),([\d.]+)\)")


def drawn(figure: Figure) -> MatplotlibFigure:
    """The figure as matplotlib's, all its panels on it. Raises MissingPackage where matplotlib is not installed."""
    try:
        from matplotlib import get_backend, pyplot  # noqa: PLC0415  optional, and slow to import
    except ImportError:
        raise MissingPackage("plots need matplotlib, which is not installed: pip install 'isp-rig[notebook]'") from None
    height_in = figure.height / PER_IN + BOTTOM_IN
    out = pyplot.figure(figsize=(WIDTH_IN, height_in))
    page = _Page(out, figure.layout, height_in)
    before: tuple[Array, Array] | None = None
    for trace in figure.traces:
        if trace.get("visible") != "legendonly":
            before = page.draw(trace, before)
    page.finish(figure.label)
    if "inline" in get_backend():
        pyplot.close(out)  # a notebook shows what a cell returns, and would show an open figure once more
    return out


class _Page:
    """The panels of one figure, each made when it is first drawn on."""

    def __init__(self, out: MatplotlibFigure, layout: Mapping[str, Any], height_in: float) -> None:
        self.out, self.layout = out, layout
        self.low, self.high = BOTTOM_IN / height_in, 1.0 - TOP_IN / height_in
        self.left = LEFT_OF_NAMES if "ticktext" in layout["yaxis"] else LEFT
        self.panels: dict[str, Axes] = {}
        for key in layout:
            if key.startswith("xaxis"):
                self._add(key.removeprefix("xaxis"))

    def _add(self, number: str) -> None:
        across, up = self.layout[f"xaxis{number}"], self.layout[f"yaxis{number}"]
        (x0, x1), (y0, y1) = across.get("domain", (0, 1)), up.get("domain", (0, 1))
        width, height = RIGHT - self.left, self.high - self.low
        box = (self.left + x0 * width, self.low + y0 * height, (x1 - x0) * width, (y1 - y0) * height)
        shared = self.panels.get("") if across.get("matches") == "x" else None
        panel = self.out.add_axes(box, sharex=shared)
        for axis, given in ((panel.xaxis, across), (panel.yaxis, up)):
            axis.set_label_text(_plain(given.get("title", {}).get("text", "")), fontsize=9)
            axis.set_tick_params(labelsize=8)
        panel.set_xscale("log" if across.get("type") == "log" else "linear")
        panel.set_yscale("log" if up.get("type") == "log" else "linear")
        if not across.get("showticklabels", True):
            panel.tick_params(labelbottom=False)
        if not up.get("showticklabels", True):
            panel.tick_params(labelleft=False)
        panel.grid(True, color="#e6e9ee", linewidth=0.6)
        panel.set_axisbelow(True)
        self.panels[number] = panel

    def draw(self, trace: Trace, before: tuple[Array, Array] | None) -> tuple[Array, Array]:
        """One line or cloud; ``before`` is the line that a fill reaches to."""
        panel = self.panels[trace["xaxis"].removeprefix("x")]
        x, y = _values(trace["x"]), _values(trace["y"])
        style: dict[str, Any] = {"alpha": trace.get("opacity"), "label": self._label(trace)}
        if "lines" in trace["mode"]:
            line = trace["line"]
            style |= {"color": _colour(line["color"]), "linestyle": STYLES[line["dash"]]}
            panel.plot(x, y, linewidth=POINTS_PER_PIXEL * line["width"], **style)
        else:
            panel.plot(x, y, linestyle="none", **{**style, **_marker(trace["marker"])})
        if "error_x" in trace:
            half, colour = _values(trace["error_x"]["array"]), _colour(trace["error_x"]["color"])
            panel.errorbar(x, y, xerr=half, fmt="none", ecolor=colour, capsize=3)
        if trace.get("fill") == "tonexty" and before is not None:
            panel.fill_between(x, y, np.interp(x, *before), color=_colour(trace["fillcolor"]), linewidth=0.0)
        return x, y

    def _label(self, trace: Trace) -> str:
        shown = trace.get("showlegend", True) and self.layout.get("showlegend", True)
        return _plain(trace.get("name", "")) if shown and trace.get("name") else "_nolegend_"

    def finish(self, label: str) -> None:
        """Ranges and ticks, which drawing would move, then shapes, texts and the legend."""
        for number, panel in self.panels.items():
            self._ranges(panel.xaxis, self.layout[f"xaxis{number}"], panel.set_xlim)
            self._ranges(panel.yaxis, self.layout[f"yaxis{number}"], panel.set_ylim)
        limits = {number: (panel.get_xlim(), panel.get_ylim()) for number, panel in self.panels.items()}
        for shape in self.layout.get("shapes", ()):
            self._shape(shape)
        for note in self.layout.get("annotations", ()):
            self._text(note)
        for number, (across, up) in limits.items():  # a noise band far beyond the data must not flatten them
            self.panels[number].set_xlim(across)
            self.panels[number].set_ylim(up)
        found: dict[str, Any] = {}
        for panel in self.panels.values():
            for handle, name in zip(*panel.get_legend_handles_labels(), strict=True):
                found.setdefault(name, handle)
        if found:
            self.out.legend(list(found.values()), list(found), loc="lower center", ncols=4, fontsize=8, frameon=False)
        self.out.set_label(label)

    @staticmethod
    def _ranges(axis: Any, given: Mapping[str, Any], set_limits: Any) -> None:
        log = given.get("type") == "log"
        if "range" in given:
            set_limits(*(10.0 ** np.asarray(given["range"]) if log else given["range"]))
        ticks = given.get("tickvals", ())
        if log:
            low, high = axis.get_view_interval()
            ticks = [tick for tick in ticks if low <= tick <= high]
            axis.set_tick_params(which="minor", labelbottom=False, labelleft=False)
        if ticks:
            names = [f"{tick:g}" for tick in ticks] if log else [_plain(name) for name in given["ticktext"]]
            axis.set_ticks(ticks, labels=names)
        elif "nticks" in given:
            axis.get_major_locator().set_params(nbins=given["nticks"] - 1)

    def _placed(self, x_of: str, y_of: str) -> tuple[Any, Any]:
        """The panel of two references, and how their coordinates are meant."""
        from matplotlib.transforms import Bbox, BboxTransformTo, blended_transform_factory  # noqa: PLC0415

        number = next((_number(ref) for ref in (x_of, y_of) if ref != "paper"), "")
        panel = self.panels.get(number, next(iter(self.panels.values())))
        area = BboxTransformTo(Bbox.from_extents(self.left, self.low, RIGHT, self.high)) + self.out.transFigure
        meant = [
            area if ref == "paper" else panel.transAxes if ref.endswith("domain") else panel.transData
            for ref in (x_of, y_of)
        ]
        return panel, blended_transform_factory(*meant)

    def _shape(self, shape: Mapping[str, Any]) -> None:
        from matplotlib.lines import Line2D  # noqa: PLC0415
        from matplotlib.patches import Rectangle  # noqa: PLC0415

        panel, transform = self._placed(shape["xref"], shape["yref"])
        x0, x1, y0, y1 = (shape[key] for key in ("x0", "x1", "y0", "y1"))
        if shape["type"] == "rect":
            fill = {"facecolor": _colour(shape["fillcolor"]), "linewidth": 0.0, "zorder": 0.5}
            panel.add_artist(Rectangle((x0, y0), x1 - x0, y1 - y0, transform=transform, **fill))
        else:
            line = shape["line"]
            how = {"color": _colour(line["color"]), "linestyle": STYLES[line.get("dash", "solid")]}
            panel.add_artist(Line2D([x0, x1], [y0, y1], linewidth=1.0, transform=transform, **how))

    def _text(self, note: Mapping[str, Any]) -> None:
        panel, transform = self._placed(note["xref"], note["yref"])
        x = note["x"]
        if not note["xref"].endswith("domain") and note["xref"] != "paper" and panel.get_xscale() == "log":
            x = 10.0**x  # plotly counts in decades there
        font = note.get("font", {})
        up = {"top": "top", "bottom": "bottom"}.get(note.get("yanchor", "middle"), "center")
        panel.text(
            x, note["y"], _plain(note["text"]), transform=transform, clip_on=False, ha=note.get("xanchor", "center"),
            va=up, fontsize=POINTS_PER_PIXEL * font.get("size", 12), color=_colour(font.get("color", "#1d2430")),
        )  # fmt: skip


def _number(reference: str) -> str:
    """ "x2 domain" and "y2" as "2"."""
    return reference.split(maxsplit=1)[0][1:]


def _values(given: Any) -> Array:
    if isinstance(given, Mapping):
        return np.frombuffer(base64.b64decode(given["bdata"]), dtype=f"<{given['dtype']}").astype(float)
    return np.asarray(given, dtype=float)


def _marker(given: Mapping[str, Any]) -> dict[str, Any]:
    symbol = given.get("symbol", "circle")
    style = {
        "marker": MARKERS.get(symbol, "o"),
        "markersize": POINTS_PER_PIXEL * given["size"],
        "color": _colour(given["color"]),
    }
    style |= {"markerfacecolor": "none"} if symbol == "circle-open" else {}
    return style | ({"alpha": given["opacity"]} if "opacity" in given else {})


def _colour(text: str) -> Any:
    found = _RGBA.fullmatch(text.replace(" ", ""))
    return (*(int(found[i]) / 255.0 for i in (1, 2, 3)), float(found[4])) if found else text


def _plain(text: str) -> str:
    """Text without plotly's markup, and without what matplotlib would set as a formula."""
    return unescape(re.sub(r"<[^>]*>", " ", text)).replace("$", r"\$")
