"""The page of trends: a section a rig, with what changed in words and a panel a quantity."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from identify.report.page.document import Gallery, document
from identify.report.page.markup import Markup, Piece, bullets, element, join, paragraph, section, table
from identify.report.page.plots.figure import AFTER, BEFORE, MEASURED, Figure, Panel, Trace, grid, upright
from identify.report.trend.change_points import MIN_CAMPAIGNS, Level
from identify.report.trend.series import Campaign, Estimate, Series, has_dates, heading, in_order, series_of
from identify.results import ParameterEstimate
from identify.wording import joined, number, percent, plain, printable, unit, with_interval

TREND_PANEL_PX, MARGIN_PX = 170, 90  # height of a panel, and of what lies above and below all panels
RULE = (
    "A change is a jump from one constant level to another, each held by at least two campaigns, that the scatter "
    "between campaigns and their intervals do not explain (BIC)."
)


def trend_html(rigs: Mapping[str, Sequence[Campaign]], failed: Sequence[tuple[str, str]] = ()) -> str:
    """One HTML file that opens without a network.

    Parameters
    ----------
    rigs
        The identified campaigns of each rig, by its name, in any order.
    failed
        Path and reason of the campaigns that could not be identified.
    """
    gallery = Gallery()
    names = sorted(rigs)
    total = sum(len(campaigns) for campaigns in rigs.values())
    kicker = f"{total} campaigns of {len(names)} rig{'s' if len(names) != 1 else ''}"
    header = element("header", element("p", kicker, class_="kicker"), element("h1", "Trends"))
    sections = [_rig(f"rig-{i}", name, in_order(rigs[name]), gallery) for i, name in enumerate(names, 1)]
    rows = [element("li", f"{path}: {reason}") for path, reason in failed]
    left_out = [section("failed", "Not identified", element("ul", *rows))] if failed else []
    return document("Trends", join([header, *sections, *left_out]), gallery.figures)


def _rig(anchor: str, name: str, campaigns: Sequence[Campaign], gallery: Gallery) -> Markup:
    found = series_of(campaigns)
    changes = [line for one in found for line in change_sentences(one, campaigns)]
    if not changes:
        few = len(campaigns) < MIN_CAMPAIGNS
        changes = [f"Detecting a change takes at least {MIN_CAMPAIGNS} campaigns." if few else "No change was found."]
    return section(
        anchor,
        printable(name),
        bullets(changes),
        paragraph(RULE, class_="note"),
        gallery.place(_figure(name, campaigns, found)),
        _campaigns(campaigns, found),
    )


def change_sentences(one: Series, campaigns: Sequence[Campaign]) -> list[str]:
    """Each change of a series in words: "stiffness K: 677.3 ± 0.2 to 650 ± 1 N·m/rad (-4.0 %), between a and b."."""
    lines = []
    for before, after in pairwise(one.levels):
        ends = [printable(campaigns[one.at[i]].name) for i in (before.last, after.first)]
        step = f" ({percent(100.0 * (after.mean / before.mean - 1.0))})" if before.mean else ""
        what = heading(one.quantity, campaigns[0].axis)
        sizes = f"{_of(before, one.unit)} to {_of(after, one.unit)} {unit(one.unit)}"
        lines.append(f"{what}: {sizes}{step}, between {ends[0]} and {ends[1]}.")
    return lines


def _of(level: Level, of_unit: str) -> str:
    return with_interval(ParameterEstimate.normal(level.mean, level.std_error, of_unit))


def _figure(name: str, campaigns: Sequence[Campaign], found: Sequence[Series]) -> Figure | None:
    if not found:
        return None
    dated = has_dates(campaigns)
    places: list[Any] = [c.played_at.isoformat() if c.played_at and dated else i for i, c in enumerate(campaigns, 1)]
    panels, traces, shapes = [], [], []
    for panel, one in enumerate(found, 1):
        extra = {"type": "date"} if dated else {"dtick": max(1, len(campaigns) // 10)}
        what = heading(one.quantity, campaigns[0].axis)
        panels.append(Panel("" if dated else "campaign", unit(one.unit), what, extra_x=extra))
        traces.append(_points(one, places, campaigns, panel))
        traces += [_level(one, level, places, panel) for level in one.levels]
        for level in one.levels[1:]:
            at, number_ = places[one.at[level.first]], "" if panel == 1 else str(panel)
            place = {"x0": at, "x1": at, "xref": f"x{number_}", "yref": f"y{number_} domain"}
            shapes.append(upright(0.0, BEFORE) | place)
    layout = grid(panels, shared_x=True, gap=0.35 / max(2, len(panels)))
    layout |= {"showlegend": False, "shapes": shapes}
    quantities = joined([panel.title for panel in panels])
    return Figure(
        label=f"{printable(name)}: {quantities} from campaign to campaign",
        caption="Points: campaigns with 95 % intervals. Lines: constant levels, dotted between two levels. "
        + ("" if dated else "Some campaigns have no date, so all are sorted by path."),
        traces=traces,
        layout=layout,
        height=TREND_PANEL_PX * len(panels) + MARGIN_PX,
    )


def _axes(panel: int) -> dict[str, str]:
    number_ = "" if panel == 1 else str(panel)
    return {"xaxis": f"x{number_}", "yaxis": f"y{number_}"}


def _points(one: Series, places: Sequence[Any], campaigns: Sequence[Campaign], panel: int) -> Trace:
    up = [_reach(e.value, e.high) for e in one.estimates]
    down = [_reach(e.low, e.value) for e in one.estimates]
    bars = {"type": "data", "array": up, "arrayminus": down, "color": AFTER, "thickness": 1.4, "width": 4}
    held = [campaigns[i] for i in one.at]
    return _axes(panel) | {
        "type": "scatter",
        "mode": "markers",
        "x": [places[i] for i in one.at],
        "y": one.values.tolist(),
        "error_y": bars,
        "marker": {"color": [AFTER if c.accepted else BEFORE for c in held], "size": 7},
        "text": [_shown(c.name) for c in held],
        "hovertemplate": "%{text}: %{y:.6g}<extra></extra>",
    }


def _level(one: Series, level: Level, places: Sequence[Any], panel: int) -> Trace:
    ends = [places[one.at[level.first]], places[one.at[level.last]]]
    style = {"color": MEASURED, "width": 1.6}
    return _axes(panel) | {
        "type": "scatter", "mode": "lines", "x": ends, "y": [level.mean] * 2, "line": style, "hoverinfo": "skip",
    }  # fmt: skip


def _reach(low: float | None, high: float | None) -> float:
    if low is None or high is None or not math.isfinite(high - low):
        return 0.0
    return max(0.0, high - low)


def _shown(name: str) -> str:
    """A name as plotly may show it, which reads its texts as HTML."""
    return printable(name).replace("&", "&amp;").replace("<", "&lt;")


def _campaigns(campaigns: Sequence[Campaign], found: Sequence[Series]) -> Markup:
    axis = campaigns[0].axis
    quantities = [f"{heading(s.quantity, axis)}, {unit(s.unit)}" for s in found]
    head: list[Piece] = ["campaign", "played", *quantities, "effects"]
    rows: list[list[Piece]] = []
    for one in campaigns:
        when = f"{one.played_at:%Y-%m-%d %H:%M}" if one.played_at else "-"
        name = printable(one.name) + ("" if one.accepted else " (not accepted)")
        cells = [_cell(one.values.get(s.quantity)) for s in found]
        rows.append([name, when, *cells, joined([plain(e) for e in one.effects])])
    return table(head, rows, "", words=(1, len(head) - 1))


def _cell(estimate: Estimate | None) -> str:
    if estimate is None:
        return "-"
    if estimate.std_error is None or estimate.low is None or estimate.high is None:
        return number(estimate.value)
    interval = (estimate.low, estimate.high)
    return with_interval(ParameterEstimate(estimate.value, estimate.std_error, interval, estimate.unit))
