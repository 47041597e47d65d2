"""Errors, noise floors and disturbances of two results: without intervals, so factors are shown and no verdict."""

from __future__ import annotations

from identify.report.captions import REPRODUCED
from identify.report.comparison.numbers import ABSENT, factor
from identify.report.comparison.saved import SavedDisturbance, SavedModel, SavedResult
from identify.report.comparison.section import Section
from identify.wording import SYMBOLS, number, percent, plain, unit

TORQUE_WITH_UNIT = {"rotary": ("torque", "N·m"), "linear": ("force", "N")}
MEASURES = {
    "holdout_rate_rms": "the held-out error of the measured channel",
    "holdout_torque_relative": "the held-out torque residual",
}
# Percent in a share.
PERCENT = {"residual_torque_relative": 100.0, "holdout_torque_relative": 100.0}


def error_section(a: SavedResult, b: SavedResult) -> Section:
    """Each measure of error of the declared and of the final model."""
    torque, torque_unit = TORQUE_WITH_UNIT[a.axis]
    comparable = a.axis == b.axis
    kinds = (
        ("held-out error of the measured channel", "holdout_rate_rms", ""),
        (REPRODUCED, "holdout_fit_percent", "%"),
        (f"{torque} residual", "residual_rms_torque", torque_unit if comparable else ""),
        (f"{torque} residual / {torque}", "residual_torque_relative", "%"),
        ("the same, held out", "holdout_torque_relative", "%"),
    )
    rows: list[tuple[str, ...]] = []
    for words, key, its_unit in kinds:
        pairs: list[tuple[str, float | None, float | None]] = [
            (f"{words}, declared model", _error(a.before, key), _error(b.before, key)),
            (f"{words}, final model", _error(a.final, key), _error(b.final, key)),
        ]
        if key in ("holdout_rate_rms", "residual_rms_torque"):
            floors = [getattr(one.noise_floor, key) for one in (a, b)]
            pairs.append((f"{words}, noise floor", floors[0], floors[1]))
        for label, first, last in pairs:
            if first is not None or last is not None:
                times = factor(first, last) if comparable and key != "holdout_fit_percent" else ABSENT
                rows.append((label, number(first), number(last), times, its_unit))
    head = ("", "A", "B", "B / A", "unit")
    return Section("Error", head, tuple(rows), tuple(_error_notes(a, b)), (0, 4))


def _error(model: SavedModel, key: str) -> float | None:
    value: float | None = getattr(model.error, key)
    return None if value is None else value * PERCENT.get(key, 1.0)


def _error_notes(a: SavedResult, b: SavedResult) -> list[str]:
    notes = ["Each folder's errors are those on its own held-out samples; they have no interval."]
    one, two = a.final.error, b.final.error
    cutoffs = one.lowpass_hz, two.lowpass_hz
    if None not in cutoffs and cutoffs[0] != cutoffs[1]:
        notes.append(
            f"The torque figures are behind different low-passes ({number(cutoffs[0], 3)} Hz in A, "
            f"{number(cutoffs[1], 3)} Hz in B): set identify.lowpass_hz to compare them."
        )
    if one.holdout_measure and two.holdout_measure and one.holdout_measure != two.holdout_measure:
        first, last = (MEASURES.get(m, plain(m)) for m in (one.holdout_measure, two.holdout_measure))
        notes.append(f"Models were chosen by {first} in A, by {last} in B.")
    return notes


def disturbance_section(a: SavedResult, b: SavedResult) -> Section:
    """What is left after either final model, as a torque."""
    first, last = a.disturbance or SavedDisturbance(), b.disturbance or SavedDisturbance()
    comparable = first.unit == last.unit
    rows: list[tuple[str, ...]] = [
        ("size, rms", number(first.torque_rms), number(last.torque_rms),
         factor(first.torque_rms, last.torque_rms) if comparable else ABSENT, unit(first.unit) if comparable else ""),
        ("share of the torque", _share(first), _share(last), factor(first.relative, last.relative), ""),
        ("depends on", _depends(a.disturbance), _depends(b.disturbance), "", ""),
    ]  # fmt: skip
    for name in dict.fromkeys((*first.moves_percent, *last.moves_percent)):
        moved = [percent(one.moves_percent.get(name)) for one in (first, last)]
        rows.append((f"moves {SYMBOLS.get(name, plain(name))} by", *moved, "", ""))
    letters = [letter for letter, one in (("A", a), ("B", b)) if one.disturbance is None]
    notes = [f"{letter} has none: it is computed only if a torque was recorded." for letter in letters]
    if len(letters) == 2:
        rows = []
    return Section("Disturbance: the torque left after the final model", ("", "A", "B", "B / A", "unit"), tuple(rows),
                   tuple(notes), (0, 4))  # fmt: skip


def _share(found: SavedDisturbance) -> str:
    return ABSENT if found.relative is None else f"{number(100.0 * found.relative, 3)} %"


def _depends(found: SavedDisturbance | None) -> str:
    if found is None:
        return ABSENT
    parts = [f"{one.on} ({number(one.torque_rms, 2)} {unit(found.unit)})" for one in found.depends_on]
    return ", ".join(parts) or "nothing"
