"""Plots as plain values in plotly's own format; page.js draws them."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from rig.recording.run import Array

MEASURED, BEFORE, AFTER, FLOOR = "#8a919b", "#d9662b", "#2b7bba", "#3c9d5d"
NOISE = "rgba(60,157,93,0.22)"  # FLOOR, see-through: where noise alone would lie
SETS = ("#5b8fd0", "#c9853f", "#4fa57c", "#b05f9c", "#8d8442", "#5aa7b5", "#a3645a", "#7a6fc0")
Trace = dict[str, Any]


@dataclass(frozen=True)
class Figure:
    """One plot: ``label`` is read aloud by a screen reader, ``caption`` stands below.

    ``zooms`` are buttons that set the range of the first x axis: (text, (from, to)), None for all.
    """

    label: str
    caption: str
    traces: Sequence[Trace]
    layout: dict[str, Any]
    height: int = 320
    heading: str = ""
    zooms: Sequence[tuple[str, tuple[float, float] | None]] = ()


@dataclass(frozen=True)
class Panel:
    """One pair of axes inside a figure."""

    x_title: str
    y_title: str
    title: str = ""
    x_log: bool = False
    y_log: bool = False
    extra_x: dict[str, Any] = field(default_factory=dict)
    extra_y: dict[str, Any] = field(default_factory=dict)


def packed(values: Array) -> dict[str, str]:
    """Single-precision numbers as plotly takes them: a fifth of the size of their digits, NaN is a gap."""
    return {"dtype": "f4", "bdata": base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode()}


def lines(x: Array, y: Array, name: str, color: str, panel: int = 1, **more: Any) -> Trace:
    """A line; traces of one name share one entry of the legend."""
    style = {"color": color, "width": more.pop("width", 1.2), "dash": more.pop("dash", "solid")}
    return _trace(x, y, name, panel, mode="lines", line=style, **more)


def points(x: Array, y: Array, name: str, color: str, panel: int = 1, **more: Any) -> Trace:
    """A cloud of markers."""
    style = {"color": color, "size": more.pop("size", 3), "opacity": more.pop("opacity", 0.35)}
    return _trace(x, y, name, panel, mode="markers", marker=style, **more)


def _trace(x: Array, y: Array, name: str, panel: int, **more: Any) -> Trace:
    number = "" if panel == 1 else str(panel)
    shown = escape(name)  # plotly reads its texts as HTML
    place = {"xaxis": f"x{number}", "yaxis": f"y{number}", "legendgroup": shown}
    return {"type": "scatter", "x": packed(x), "y": packed(y), "name": shown} | place | more


def once_in_legend(traces: Sequence[Trace]) -> list[Trace]:
    """The traces with one legend entry a name, that of the first."""
    seen: set[str] = set()
    out = []
    for trace in traces:
        out.append(trace | {"showlegend": trace["name"] not in seen and trace.get("showlegend", True)})
        seen.add(trace["name"])
    return out


def grid(panels: Sequence[Panel], columns: int = 1, shared_x: bool = False, gap: float = 0.09) -> dict[str, Any]:
    """Layout of panels in rows; with ``shared_x`` all follow the zoom of the first."""
    rows = -(-len(panels) // columns)
    layout: dict[str, Any] = {"annotations": []}
    for i, panel in enumerate(panels):
        number = "" if i == 0 else str(i + 1)
        row, column = divmod(i, columns)
        x0, x1 = _span(column, columns, gap)
        y0, y1 = _span(rows - 1 - row, rows, gap)
        last = row == rows - 1
        layout[f"xaxis{number}"] = _axis(panel.x_title if last or not shared_x else "", panel.x_log) | {
            "domain": [x0, x1],
            "anchor": f"y{number}",
            "showticklabels": last or not shared_x,
            **({"matches": "x"} if shared_x and i else {}),
            **panel.extra_x,
        }
        layout[f"yaxis{number}"] = (
            _axis(panel.y_title, panel.y_log) | {"domain": [y0, y1], "anchor": f"x{number}"} | panel.extra_y
        )
        if panel.title:
            layout["annotations"].append(_title(panel.title, x0, y1))
    return layout


def _span(index: int, count: int, gap: float) -> tuple[float, float]:
    width = (1.0 - gap * (count - 1)) / count
    return index * (width + gap), index * (width + gap) + width


def _axis(title: str, log: bool) -> dict[str, Any]:
    scale = {"type": "log", "exponentformat": "power"} if log else {"exponentformat": "power"}
    return {"title": {"text": escape(title), "standoff": 6}, "automargin": True, "zeroline": False, **scale}


def _title(words: str, x: float, y: float) -> dict[str, Any]:
    place = {"xref": "paper", "yref": "paper", "xanchor": "left", "yanchor": "bottom"}
    return {"text": escape(words), "x": x, "y": y, "showarrow": False, "font": {"size": 12}, **place}


def level(y: float, color: str, panel: int = 1, dash: str = "dash") -> dict[str, Any]:
    """A horizontal line across a panel, as a shape."""
    number = "" if panel == 1 else str(panel)
    style = {"line": {"color": color, "width": 1.2, "dash": dash}, "layer": "above"}
    return {
        "type": "line",
        "xref": f"x{number} domain",
        "x0": 0,
        "x1": 1,
        "yref": f"y{number}",
        "y0": y,
        "y1": y,
    } | style


def upright(x: float, color: str) -> dict[str, Any]:
    """A vertical dotted line through the first panel, as a shape."""
    style = {"line": {"color": color, "width": 1.2, "dash": "dot"}, "layer": "below"}
    return {"type": "line", "xref": "x", "x0": x, "x1": x, "yref": "y domain", "y0": 0, "y1": 1} | style


def band(x0: float, x1: float, panel: int = 1) -> dict[str, Any]:
    """A shaded stretch of x, as a shape behind the data."""
    number = "" if panel == 1 else str(panel)
    style = {"fillcolor": "rgba(128,140,160,0.16)", "line": {"width": 0}, "layer": "below"}
    return {
        "type": "rect",
        "xref": f"x{number}",
        "yref": f"y{number} domain",
        "x0": x0,
        "x1": x1,
        "y0": 0,
        "y1": 1,
    } | style


def noise_band(half: float, panel: int = 1) -> dict[str, Any]:
    """Everything nearer to zero than ``half``, in the unit of the panel's y axis, as a shape behind the data."""
    number = "" if panel == 1 else str(panel)
    style = {"fillcolor": NOISE, "line": {"width": 0}, "layer": "below"}
    span = {"xref": f"x{number} domain", "yref": f"y{number}", "x0": 0, "x1": 1, "y0": -half, "y1": half}
    return {"type": "rect"} | span | style
