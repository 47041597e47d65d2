"""Rows of the table to the page of trends; campaigns of one rig are those whose configurations share a name."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from commands.identify_batch.row import FAILED, PARAMETERS, Row

if TYPE_CHECKING:
    from identify.report.trend import Campaign, Estimate


def write_trends(path: Path, rows: Sequence[Row]) -> None:
    """Write the page in one piece. Raises OSError where it cannot be written."""
    from identify.report.replaced_file import replace_file
    from identify.report.trend import trend_html

    rigs: dict[str, list[Campaign]] = {}
    for row in rows:
        if row["status"] != FAILED:
            linear = " (linear axis)" if row["axis"] == "linear" else ""
            rigs.setdefault(f"{row['rig']}{linear}", []).append(_campaign(row))
    failed = [(row["path"], row["reason"]) for row in rows if row["status"] == FAILED]
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, trend_html(rigs, failed))


def _campaign(row: Row) -> Campaign:
    from commands.identify_batch.table import moment
    from identify.report.trend import Campaign, Estimate

    values = {name: _parameter(row, name) for name in PARAMETERS if row[f"{name}_value"] is not None}
    for effect, parameters in json.loads(row["effect_parameters_json"] or "{}").items():
        for name, one in parameters.items():
            if one["value"] is not None:
                values[f"{effect}.{name}"] = Estimate(one["value"], one["unit"], one["std_error"], *one["ci95"])
    if row["disturbance_torque_rms"] is not None:
        values["disturbance"] = Estimate(row["disturbance_torque_rms"], row["disturbance_unit"])
    return Campaign(
        row["name"], row["path"], row["axis"], bool(row["accepted"]), tuple(row["effects"]),
        moment(row["recorded_utc"]) if row["recorded_utc"] else None, values,
    )  # fmt: skip


def _parameter(row: Row, name: str) -> Estimate:
    from identify.report.trend import Estimate

    low, high = row[f"{name}_ci95_low"], row[f"{name}_ci95_high"]
    return Estimate(row[f"{name}_value"], row[f"{name}_unit"], row[f"{name}_std_error"], low, high)
