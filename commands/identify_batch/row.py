"""One row of the table: what became of one campaign, as plain values that JSON holds exactly."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from commands.identify_batch.campaigns import Job
    from identify.results import Errors, Identification, ParameterEstimate

Row = dict[str, Any]
IDENTIFIED, FAILED = "identified", "failed"
PARAMETERS = ("inertia", "damping", "stiffness", "damping_over_inertia", "stiffness_over_inertia")
FIGURES = (
    "residual_rms_torque", "holdout_rate_rms", "holdout_fit_percent", "residual_torque_relative",
    "holdout_torque_relative",
)  # fmt: skip
TEXT, TEXTS, NUMBER, FLAG, TIME = "text", "texts", "number", "flag", "time"


def _of_parameter(name: str) -> dict[str, str]:
    numbers = {f"{name}_{part}": NUMBER for part in ("value", "std_error", "ci95_low", "ci95_high")}
    return numbers | {f"{name}_unit": TEXT}


# Column -> kind, in the order of the table.
COLUMNS: dict[str, str] = {
    "path": TEXT, "name": TEXT, "rig": TEXT, "config_sha256": TEXT, "content_sha256": TEXT, "recorded_utc": TIME,
    "status": TEXT, "accepted": FLAG, "aborted": FLAG, "reason": TEXT, "axis": TEXT, "effects": TEXTS,
    **{column: kind for name in PARAMETERS for column, kind in _of_parameter(name).items()},
    "effect_parameters_json": TEXT, "not_determined": TEXTS,
    **{f"{figure}_{when}": NUMBER for when in ("before", "after") for figure in FIGURES},
    "holdout_measure": TEXT,
    "disturbance_torque_rms": NUMBER, "disturbance_relative": NUMBER, "disturbance_unit": TEXT,
    "disturbance_depends_on": TEXTS, "unexplained": FLAG,
    "results": TEXT, "version": TEXT, "seconds": NUMBER,
}  # fmt: skip


def failed_row(job: Job, reason: str, version: str, seconds: float, known: Mapping[str, Any] | None = None) -> Row:
    """The row of a campaign from which nothing came; ``known`` is what had been found out before that, if anything."""
    own = {"path": job.path, "content_sha256": job.content, "status": FAILED, "reason": reason, "version": version}
    return dict.fromkeys(COLUMNS) | dict(known or {}) | own | {"seconds": seconds}


def row_of(
    job: Job, found: Identification, known: Mapping[str, Any], results: str | None, version: str, seconds: float
) -> Row:
    """The row of an identified campaign.

    Parameters
    ----------
    known
        ``name``, ``rig``, ``config_sha256``, ``recorded_utc`` (ISO 8601 or None).
    results
        The campaign's results folder, if it was kept.
    seconds
        What the identification took on its worker.
    """
    from identify.report.json_values import finite

    final, left = found.final, found.disturbance
    row = dict.fromkeys(COLUMNS) | dict(known)
    row |= {
        "path": job.path, "content_sha256": job.content, "status": IDENTIFIED, "accepted": found.accepted,
        "aborted": found.aborted, "reason": "\n".join(found.reasons), "axis": found.axis,
        "effects": list(found.verdict.effects), "unexplained": found.verdict.unexplained,
        "not_determined": [item.name for item in final.not_determined],
        "holdout_measure": final.error.holdout_measure, "results": results, "version": version, "seconds": seconds,
    }  # fmt: skip
    for name in PARAMETERS:
        if name in final.parameters:
            row |= _parameter(name, final.parameters[name])
    each = {e: {p: _estimate(x) for p, x in ps.items()} for e, ps in final.effect_parameters.items()}
    row["effect_parameters_json"] = json.dumps(finite(each), sort_keys=True, allow_nan=False)
    row |= _errors(found.before.error, "before")
    if found.after is not None:
        row |= _errors(found.after.error, "after")
    if left is not None:
        row |= {
            "disturbance_torque_rms": left.torque_rms, "disturbance_relative": left.relative,
            "disturbance_unit": left.unit, "disturbance_depends_on": [d.on for d in left.depends_on],
        }  # fmt: skip
    plain: Row = finite(row)
    return plain


def _parameter(name: str, estimate: ParameterEstimate) -> Row:
    low, high = estimate.ci95
    return {
        f"{name}_value": estimate.value, f"{name}_std_error": estimate.std_error, f"{name}_ci95_low": low,
        f"{name}_ci95_high": high, f"{name}_unit": estimate.unit,
    }  # fmt: skip


def _estimate(estimate: ParameterEstimate) -> dict[str, Any]:
    return {
        "value": estimate.value, "std_error": estimate.std_error, "ci95": list(estimate.ci95), "unit": estimate.unit
    }  # fmt: skip


def _errors(error: Errors, when: str) -> Row:
    return {f"{figure}_{when}": getattr(error, figure) for figure in FIGURES}
