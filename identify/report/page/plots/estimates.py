"""Every parameter from every set, with its interval, around the final value."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from identify.report.page.plots.figure import AFTER, BEFORE, MEASURED, Figure, Panel, Trace, grid, level
from identify.results import Identification, ParameterEstimate
from identify.wording import percent, title, value_of

MAX_SPREADS = 3.0  # an estimate further out than this many times the spread of the others is named, not drawn


def estimates_figure(identification: Identification) -> Figure | None:
    """One panel a parameter of the platform: all runs together, each set, and the declared model alone."""
    final = identification.final.parameters
    names = [name for name, estimate in final.items() if estimate.value != 0.0]
    if not names:
        return None
    rows = [("all sets", final, AFTER)]
    rows += [(one.name, one.parameters, MEASURED) for one in identification.per_set]
    if identification.after is not None:
        rows.append(("declared model alone", identification.before.parameters, BEFORE))
    drawn: list[Trace] = []
    panels, notes = [], []
    for panel, name in enumerate(names, 1):
        centre = final[name].value
        relative = [(label, _relative(values.get(name), centre), color) for label, values, color in rows]
        reach = MAX_SPREADS * max(abs(p[0]) + p[1] for label, p, _ in relative if p and label != "declared model alone")
        for at, (label, point, color) in enumerate(relative):
            inside = point is not None and abs(point[0]) <= max(reach, 1e-9)
            if inside and point:
                drawn.append(_point(point, at, label, color, panel))
            else:
                notes.append(_note("not determined" if point is None else percent(point[0]), at, panel, color, point))
        labels = [escape(label[:20]) for label, _, _ in rows]  # plotly reads its texts as HTML
        ticks = {"tickvals": list(range(len(rows))), "ticktext": labels, "range": [len(rows) - 0.5, -0.5]}
        away = f"% from {value_of(final[name])}"
        extra_y: dict[str, Any] = {**ticks, "showticklabels": panel == 1, "showgrid": False}
        panels.append(
            Panel(away, "", title(name, identification.axis), extra_y=extra_y, extra_x={"nticks": 5, "zeroline": True})
        )
    layout = grid(panels, columns=len(panels), gap=0.05)
    layout["annotations"] += notes
    layout["showlegend"] = False
    layout["shapes"] = [level(0.5, MEASURED, p, dash="dot") for p in range(1, len(panels) + 1)]
    return Figure(
        label="Parameters of every set with their 95 % intervals, in percent of the final value",
        caption="95 % intervals. Values far outside the axis are written at its edge.",
        traces=drawn,
        layout=layout,
        height=110 + 34 * len(rows),
    )


def _relative(estimate: ParameterEstimate | None, centre: float) -> tuple[float, float] | None:
    """Deviation from ``centre`` and half the 95 % interval, in percent."""
    if estimate is None or not np.isfinite(estimate.value):
        return None
    half = 0.5 * abs(estimate.ci95[1] - estimate.ci95[0])
    scale = 100.0 / abs(centre)
    return (estimate.value - centre) * scale, half * scale if np.isfinite(half) else 0.0


def _point(point: tuple[float, float], at: int, label: str, color: str, panel: int) -> Trace:
    number = "" if panel == 1 else str(panel)
    return {
        "type": "scatter",
        "mode": "markers",
        "x": [point[0]],
        "y": [at],
        "xaxis": f"x{number}",
        "yaxis": f"y{number}",
        "marker": {"color": color, "size": 9},
        "error_x": {"type": "data", "array": [point[1]], "color": color, "thickness": 1.6, "width": 5},
        "hovertemplate": "%{x:.4g} % ± %{error_x.array:.2g} %<extra></extra>",
    }


def _note(words: str, at: int, panel: int, color: str, point: tuple[float, float] | None) -> dict[str, Any]:
    number = "" if panel == 1 else str(panel)
    left = point is not None and point[0] < 0.0
    arrow = "" if point is None else "← " if left else " →"
    return {
        "text": f"{arrow}{words}" if left else f"{words}{arrow}",
        "xref": f"x{number} domain",
        "x": 0.02 if left else 0.98 if point else 0.5,
        "xanchor": "left" if left else "right" if point else "center",
        "yref": f"y{number}",
        "y": at,
        "showarrow": False,
        "font": {"size": 11, "color": color},
    }
