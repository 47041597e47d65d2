"""The results folder: result.json, model.yaml, follow_up.yaml, recording.h5, report.html and report_data.h5."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from identify.conclude.next_steps import next_steps
from identify.diagnose.wording import diagnosis_sentences
from identify.follow_up.wording import follow_up_yaml
from identify.model.parameters import with_inertia
from identify.report.json_values import finite
from identify.report.page import report_html
from identify.report.proof import proof_json
from identify.report.replaced_file import replace_file
from identify.report.report_data import FILE as REPORT_DATA
from identify.report.report_data import image_of, report_data
from identify.residual import Disturbance
from identify.results import (
    Errors,
    FollowUp,
    FollowUpPlan,
    GeneticRun,
    Identification,
    ModelResult,
    NotReported,
    ParameterEstimate,
    SetResult,
    Verdict,
    follow_up_file_name,
)
from identify.wording import bias_percent
from rig.config.model import model_yaml
from rig.platform import Platform
from rig.recording.hdf5 import write_recording_h5
from rig.recording.journal_reader import JournalContents
from rig.recording.run import Recording

SCHEMA_VERSION = 1  # of result.json


def result_json(identification: Identification) -> dict[str, Any]:
    """result.json as plain values; null where there is no number, never NaN or infinity."""
    final = identification.final
    content = {
        "schema_version": SCHEMA_VERSION,
        "accepted": identification.accepted,
        "reasons": list(identification.reasons),
        "next": list(next_steps(identification)),
        "aborted": identification.aborted,
        "axis": identification.axis,
        "before": _model(identification.before),
        "verdict": _verdict(identification.verdict),
        "after": _model(identification.after) if identification.after else None,
        "noise_floor": dict(vars(identification.noise_floor)),
        "disturbance": _disturbance(identification.disturbance),
        "declared": dict(identification.declared),
        "plausibility": [dict(vars(one)) for one in identification.plausibility],
        "note": identification.note,
        "residual": _residual(identification),
        "per_set": [_set(one) for one in identification.per_set],
        "set_scatter": identification.set_scatter,
        "torque_scale": _parameter(identification.torque_scale) if identification.torque_scale else None,
        "max_error_percent": identification.max_error_percent,
        "dropped": _listed(final.dropped),
        "not_determined": _listed(final.not_determined),
        "bias_percent": bias_percent(identification),
        "genetic": _genetic(identification.joint) if identification.joint else None,
        "holdout": identification.holdout_note,
        "follow_up": _follow_up(identification) if identification.follow_up else None,
        "proof": proof_json(identification.proof) if identification.proof else None,
    }
    if identification.max_error_percent is None:
        del content["max_error_percent"]
    return {key: finite(value) for key, value in content.items()}


def _model(model: ModelResult) -> dict[str, Any]:
    return {
        "parameters": {name: _parameter(p) for name, p in model.parameters.items()},
        "effect_parameters": {
            effect: {name: _parameter(p) for name, p in parameters.items()}
            for effect, parameters in model.effect_parameters.items()
        },
        "error": _error(model.error),
        "dropped": _listed(model.dropped),
        "not_determined": _listed(model.not_determined),
        "correlation": model.correlation,
    }


def _disturbance(found: Disturbance | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return dict(vars(found)) | {"depends_on": [dict(vars(d)) for d in found.depends_on]}


def _residual(identification: Identification) -> dict[str, Any]:
    """Where the residual of either model lives: shares of its power with what chance would show, and in words."""
    found = {"before": identification.residual_before, "after": identification.residual_after}
    return {
        which: asdict(one) | {"sentences": list(diagnosis_sentences(one, identification.axis))} if one else None
        for which, one in found.items()
    }


def _parameter(estimate: ParameterEstimate) -> dict[str, Any]:
    content = dict(vars(estimate)) | {"ci95": list(estimate.ci95)}
    if estimate.max_error_percent is None:
        del content["max_error_percent"]
    return content


def _error(error: Errors) -> dict[str, Any]:
    return dict(vars(error))


def _listed(several: Sequence[NotReported]) -> list[dict[str, str]]:
    return [{"name": item.name, "reason": item.reason} for item in several]


def _verdict(verdict: Verdict) -> dict[str, Any]:
    return dict(vars(verdict)) | {
        "candidates": [dict(vars(candidate)) for candidate in verdict.candidates],
        "rival_models": {
            effect: {rival: dict(vars(platform)) for rival, platform in models.items()}
            for effect, models in verdict.rival_models.items()
        },
    }


def _follow_up(identification: Identification) -> dict[str, Any] | None:
    """What to play next, what was played, what became of each pair, and the error at each step on the same samples."""
    found: FollowUp | None = identification.follow_up
    if found is None:
        return None
    errors = None
    if found.error_without is not None:
        models = {
            "before": identification.before.error, "after": found.error_without,
            "after_follow_up": identification.final.error,
        }  # fmt: skip
        errors = {name: _error(error) for name, error in models.items()}
    return {
        "planned": _plan(found.plan, follow_up_file_name(len(found.rounds))) if found.plan else None,
        "not_planned": [dict(vars(one)) for one in found.unparted],
        "played": bool(found.rounds),
        "rounds": [
            {"plan": _plan(r.plan, follow_up_file_name(n)), "separated": _pairs(r.separated), "open": _pairs(r.open)}
            for n, r in enumerate(found.rounds)
        ],
        "separated": [pair for r in found.rounds for pair in _pairs(r.separated)],
        "note": found.note,
        "error": errors,
    }  # fmt: skip


def _plan(plan: FollowUpPlan, file: str) -> dict[str, Any]:
    return {
        "file": file, "why": plan.why, "duration_s": plan.duration_s, "excitation": plan.excitation,
        "pairs": [dict(vars(one)) for one in plan.partings],
    }  # fmt: skip


def _pairs(several: Sequence[tuple[str, str]]) -> list[dict[str, str]]:
    return [{"effect": effect, "rival": rival} for effect, rival in several]


def _set(one: SetResult) -> dict[str, Any]:
    errors = {n: p.max_error_percent for n, p in one.parameters.items() if p.max_error_percent is not None}
    content = dict(vars(one)) | {
        "parameters": {name: _parameter(p) for name, p in one.parameters.items()},
        "genetic": _genetic(one.genetic) if one.genetic else None,
    }
    return content | ({"max_error_percent": errors} if errors else {})


def _genetic(run: GeneticRun) -> dict[str, Any]:
    """All but the history, which the report draws."""
    return {key: value for key, value in vars(run).items() if key != "history"} | {"generations": len(run.history)}


def final_platform(identification: Identification, declared: Platform, inertia_declared: bool = True) -> Platform:
    """The identified platform, fit to be declared or simulated next.

    It replays the runs; what they do not determine keeps the declared value where it replays them so, too. Without
    torque all is known per unit of inertia: the declared inertia sets the scale, and where none was declared the
    inertia stays at one.

    Raises
    ------
    ValueError
        Where no model was identified.
    """
    found = identification.final.platform
    if found is None:
        raise ValueError("no model was identified")
    return with_inertia(found, declared.inertia_kg_m2) if identification.torque_free and inertia_declared else found


def model_text(identification: Identification, declared: Platform, inertia_declared: bool = True) -> str:
    """model.yaml: the augmented model, with what stands behind its numbers as a comment.

    Raises
    ------
    ValueError
        Where the identified numbers are none that a model may have (an inertia that is not positive).
    """
    final, platform = identification.final, final_platform(identification, declared, inertia_declared)
    lines = [
        "The identified model. Use it as `model:` of the next campaign (a path, or pasted), or as",
        "`simulated.platform:` for a twin of the rig.",
    ]
    if not identification.accepted:
        lines.append("NOT ACCEPTED: read report.html before you use this model.")
    if identification.axis == "linear":
        lines.append(
            "Linear axis: the values are in kg, N s/m and N/m although the keys say kg m^2, N m s/rad and N m/rad."
        )
    if identification.torque_free:
        lines += _scale_lines(declared, inertia_declared)
    lines += [f"Dropped: {item.name}: {item.reason}" for item in final.dropped]
    lines += [f"{_standing(item)}: {item.name}: {item.reason}" for item in final.not_determined]
    unknown = identification.torque_free and not inertia_declared
    return model_yaml(platform, "\n".join(" ".join(line.split()) for line in lines), unknown)


def _scale_lines(declared: Platform, inertia_declared: bool) -> list[str]:
    """What the numbers of a decay without torque are worth."""
    if inertia_declared:
        return [
            "No torque was recorded, so only ratios to the inertia are known: the declared inertia sets the scale.",
            f"All other values are in proportion to the declared inertia of {declared.inertia_kg_m2:g} kg m^2 and "
            "share its error.",
        ]
    return [
        "ONLY RATIOS TO THE INERTIA ARE KNOWN: no torque was recorded and no inertia declared (model.inertia_kg_m2).",
        "All values below are per unit of inertia. They reproduce the decay but not the response to a torque:",
        "`backend: bench` refuses this model. Declare the inertia and identify again; or multiply all values in N "
        "m (N m s/rad,",
        "...) by the inertia, set inertia_kg_m2 to it and remove inertia_unknown.",
    ]


def _standing(item: NotReported) -> str:
    """What the number of a parameter is that the data do not determine."""
    if item.as_declared:
        return "Not determined, kept as declared"
    return (
        "Not determined, NOT as declared: a fitted value, valid only together with the other values and for similar "
        "motion"
    )


def write_results(
    folder: Path,
    identification: Identification,
    recording: Recording,
    declared: Platform,
    name: str,
    journal: JournalContents | None = None,
    inertia_declared: bool = True,
) -> tuple[Path, ...]:
    """Write model.yaml, follow_up.yaml, result.json, recording.h5, report.html, report_data.h5 into ``folder``.

    ``declared`` is the platform of the configuration, ``name`` the campaign's; ``inertia_declared`` is false where
    the inertia is a default that nobody stands for. A recording.h5 that stands
    there already is left alone. Each file appears whole or not at all, in this order: on a disk that fills up, the
    numbers are there. Returns the paths written; model.yaml is left out where no valid model came out, follow_up.yaml
    where nothing is planned, report_data.h5 where a campaign is too long for it.

    Raises
    ------
    OSError
        Where the folder cannot be written (full disk, no permission).
    JournalError
        The same, while writing recording.h5.
    """
    try:
        texts = {"model.yaml": model_text(identification, declared, inertia_declared)}
    except ValueError:
        texts = {}
    follow_up = identification.follow_up
    if follow_up is not None and follow_up.plan is not None:
        texts[follow_up_file_name(len(follow_up.rounds))] = follow_up_yaml(follow_up.plan)
    texts["result.json"] = json.dumps(result_json(identification), indent=1, allow_nan=False) + "\n"
    written = [replace_file(folder / file, text) for file, text in texts.items()]
    if not (folder / "recording.h5").exists():
        write_recording_h5(folder / "recording.h5", recording, journal)
        written.append(folder / "recording.h5")
    written.append(replace_file(folder / "report.html", report_html(identification, recording, name)))
    kept = image_of(report_data(identification, tuple(run.name for run in recording.runs), name))
    if kept is not None:
        written.append(replace_file(folder / REPORT_DATA, kept))
    return tuple(written)
