"""The page of trends."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from identify.report.trend import Campaign, Estimate, trend_html
from identify.report.trend.series import series_of

START = datetime(2025, 3, 1, 12, tzinfo=UTC)


def campaign(number: int, stiffness: float, friction: float | None = 0.4, **changed: Any) -> Campaign:
    values = {
        "inertia": Estimate(0.02, "kg*m^2", 1e-5, 0.01998, 0.02002),
        "stiffness": Estimate(stiffness, "N*m/rad", 0.5, stiffness - 1.0, stiffness + 1.0),
        "torque_delay.delay": Estimate(1e-3, "s", 1e-5, 0.9e-3, 1.1e-3),
        "disturbance": Estimate(0.01, "N*m"),
    }
    if friction is not None:
        values["coulomb_friction.level"] = Estimate(friction, "N*m", 1e-3, friction - 2e-3, friction + 2e-3)
    made = Campaign(
        f"day {number}", f"runs/{number:03d}", "rotary", True, ("coulomb_friction",),
        START + timedelta(days=number), values,
    )  # fmt: skip
    return replace(made, **changed)


def softened(count: int = 12, **changed: Any) -> list[Campaign]:
    """Half of the campaigns before the spring softened, half after."""
    noise = 0.5 * np.random.default_rng(1).standard_normal(count)
    return [campaign(i, (677.0 if i < count // 2 else 650.0) + noise[i], **changed) for i in range(count)]


def words(page: str) -> str:
    body = page.split("<main>")[1].split("</main>", maxsplit=1)[0]
    return " ".join(re.sub(r"<[^>]+>", " ", body).split())


def figures(page: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(re.findall(r'id="figures">(.*?)</script>', page, re.S)[0])
    return found


def test_a_change_is_said_with_both_levels_and_the_campaigns_between() -> None:
    text = words(trend_html({"bench-a": softened()[::-1]}))
    sizes = r"67\d\.\d+ ± 0\.\d+ to 6\d\d\.\d+ ± 0\.\d+ N·m/rad \(-[34]\.\d+ %\)"
    assert re.search(rf"stiffness K: {sizes}, between day 5 and day 6\.", text)
    assert "rotary inertia J:" not in text


def test_without_a_change_or_with_too_few_campaigns_the_page_says_so() -> None:
    steady = [campaign(i, 677.0) for i in range(8)]
    assert "No change was found." in words(trend_html({"a": steady}))
    assert "Detecting a change takes at least 6 campaigns." in words(trend_html({"a": steady[:5]}))


def test_each_rig_has_a_figure_that_plotly_takes_with_intervals_and_levels() -> None:
    page = trend_html({"b": [campaign(0, 1.0)], "a": softened()})
    drawn = figures(page)
    assert list(drawn) == ["figure-1", "figure-2"]
    assert page.index("<h2>a</h2>") < page.index("<h2>b</h2>")
    figure = go.Figure(drawn["figure-1"]["data"], drawn["figure-1"]["layout"])
    stiffness = [trace for trace in figure.data if trace.yaxis == "y2"]
    assert len(stiffness) == 3  # the campaigns and two levels
    assert stiffness[0].x[0] == START.isoformat()
    assert list(stiffness[0].error_y.array) == pytest.approx([1.0] * 12)
    assert len(figure.layout.shapes) == 1


def test_campaigns_stand_by_date_where_all_have_one_else_by_path() -> None:
    late = [campaign(1, 677.0), campaign(2, 650.0, played_at=START - timedelta(days=9))]
    assert figures(trend_html({"a": late}))["figure-1"]["data"][0]["text"] == ["day 2", "day 1"]
    unknown = [late[0], replace(late[1], played_at=None)]
    page = trend_html({"a": unknown})
    assert figures(page)["figure-1"]["data"][0]["text"] == ["day 1", "day 2"]
    assert "Some campaigns have no date, so all are sorted by path" in words(page)


def test_series_are_j_c_k_levels_of_friction_and_the_disturbance() -> None:
    campaigns = [campaign(0, 677.0, None), campaign(1, 677.0), campaign(2, 677.0)]
    found = {one.quantity: one.at for one in series_of(campaigns)}
    assert found == {
        "inertia": (0, 1, 2), "stiffness": (0, 1, 2), "coulomb_friction.level": (1, 2), "disturbance": (0, 1, 2)
    }  # fmt: skip


def test_what_failed_is_listed_and_no_name_becomes_html() -> None:
    hostile = "<script>alert(1)</script>"
    page = trend_html({hostile: [campaign(0, 1.0, name=hostile)]}, [(hostile, "is damaged")])
    assert hostile not in page
    assert "is damaged" in words(page)


def test_the_page_holds_all_it_needs() -> None:
    page = trend_html({"a": softened()})
    assert "default-src 'none'" in page
    assert not re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="(?!data:)', page)
