"""An identification in three sentences: what was found, what it changes, and whether it is accepted and why."""

from __future__ import annotations

from identify.conclude.acceptance import opposite_signs
from identify.model.parameter_fit import reduced_chi_square
from identify.residual import FROM_RUN_TO_RUN
from identify.results import Identification
from identify.runs.sign_convention import SENTENCE
from identify.wording import (
    SYMBOLS,
    bias_percent,
    capital,
    joined,
    number,
    off_by,
    plain,
    quantities_of,
    quantity_of,
    readable,
    sentence,
    unit,
    value_in_sentence,
)

MAX_REASONS = 2  # of a result that is not accepted; the list below has all
TOLD_AT_NOISE = 1.05**2  # reduced chi-square; the noise floor is known to a few percent
MIN_CHANGE_PERCENT = 1.0  # of a parameter: less is in the table
UNITS = {("rotary", "rate"): "rad/s", ("rotary", "angle"): "rad", ("linear", "rate"): "m/s", ("linear", "angle"): "m"}


def headline(found: Identification) -> tuple[str, str, str]:
    """Three sentences for the first screen of the report."""
    return _found(found), _error(found), accepted_or_not(found)


def _found(found: Identification) -> str:
    if opposite_signs(found):
        return sentence(capital(SENTENCE))
    named = [_with_first_number(found, name) for name in found.verdict.effects]
    if named:
        more = ", and one more effect that these data do not determine" if found.verdict.left_open else ""
        return f"The declared model lacks {joined(named)}{more}."
    if found.verdict.left_open:
        return "Something is missing from the declared model, and these data do not determine what."
    if found.verdict.unexplained:
        if not found.accepted:
            return _changing(found) or "The declared model lacks something that no effect here describes."
        torque = "force" if found.axis == "linear" else "torque"
        left = found.disturbance
        size = (
            ""
            if left is None
            else f" but for {number(100.0 * left.relative, 2)} % of the {torque} (sensor noise removed)"
        )
        return f"The declared model describes these runs{size}: what is left is too little to matter."
    return "The declared model describes these runs: no effect is missing."


def _changing(found: Identification) -> str:
    """That an inertia, a damping or the like changes, where that is most of what is left; empty where it is not."""
    parts = () if found.disturbance is None else found.disturbance.depends_on
    most = max(parts, key=lambda d: d.relative, default=None)
    if most is None or not most.changes:
        return ""
    if most.changes == FROM_RUN_TO_RUN:
        return "The declared model does not hold for all runs: J, C and K fitted to each run by itself differ."
    quantity = quantity_of(most, found.axis)
    return f"The declared model takes the {most.changes} for constant, and it changes with the {quantity}."


def _with_first_number(found: Identification, name: str) -> str:
    values = found.final.effect_parameters.get(name, {})
    if not values:
        return plain(name)
    what, value = next(iter(values.items()))
    shown = readable(value)
    return f"{plain(name)} ({what.replace('_', ' ')} {value_in_sentence(shown)} {unit(shown.unit)})".replace(" 1)", ")")


def error_before_and_after(found: Identification) -> tuple[float | None, float | None, float | None, str]:
    """The held-out error that decided: of the declared and of the final model, its floor, and its unit."""
    before, after, floor = found.before.error, found.final.error, found.noise_floor
    if after.holdout_measure == "holdout_torque_relative":
        pair = [
            None if x is None else 100.0 * x for x in (before.holdout_torque_relative, after.holdout_torque_relative)
        ]
        return pair[0], pair[1], None, "% of the force" if found.axis == "linear" else "% of the torque"
    channel = found.traces[0].channel if found.traces else "rate"
    return before.holdout_rate_rms, after.holdout_rate_rms, floor.holdout_rate_rms, UNITS[found.axis, channel]


def _error(found: Identification) -> str:
    old, new, floor, its_unit = error_before_and_after(found)
    if new is None:
        return "No error could be measured on held-out data."
    at_floor = floor and reduced_chi_square(new, floor) < TOLD_AT_NOISE
    times = ", the noise floor" if at_floor else f", {number(new / floor, 2)} times the noise floor" if floor else ""
    if found.after is None or old is None:
        return f"Its error on held-out data is {number(new, 3)} {its_unit}{times}."
    before, now = number(old, 3), number(new, 3)
    change = f"{'falls' if new < old else 'changes'} from {before} to {now}" if now != before else f"stays at {now}"
    text = f"With the final model the error on held-out data {change} {its_unit}"
    final = found.final.parameters
    moved = [
        f"{SYMBOLS.get(name, plain(name))} would be {off_by(1.0 + percent / 100.0)}"
        for name, percent in bias_percent(found).items()
        if abs(percent) >= MIN_CHANGE_PERCENT and name in final
    ]
    return f"{text}{times}{'; without it, ' + joined(moved) if moved else ''}."


def accepted_or_not(found: Identification) -> str:
    """Accepted or not, and why, in one sentence."""
    if not found.accepted:
        shown, more = list(found.reasons[:MAX_REASONS]), len(found.reasons) - MAX_REASONS
        rest = f" ({more} more reason{'s' if more > 1 else ''} below)" if more > 0 else ""
        why = f"{'; '.join(shown).rstrip(' .')}{rest}." if shown else ""
        return f"{'Aborted' if found.aborted else 'Not accepted'}: {why}" if why else "Not accepted."
    names = [SYMBOLS.get(name, plain(name)) for name in found.final.parameters]
    determined = f"{joined(names)} {'are' if len(names) > 1 else 'is'} determined" if names else "nothing is left open"
    return f"Accepted: {determined}, and {_left(found)}."


def _left(found: Identification) -> str:
    left, torque = found.disturbance, "force" if found.axis == "linear" else "torque"
    if left is None:
        return "what is left is at the noise floor"
    if left.relative == 0.0:
        return f"no {torque} is left above the sensor's noise"
    if not left.depends_on:
        share = f"{number(100.0 * left.relative, 2)} % of the {torque}, sensor noise removed"
        return f"the residual {torque} ({share}) depends on no quantity that was tested"
    on = quantities_of(left.depends_on, found.axis)
    moved = joined([f"{SYMBOLS[k]} by {number(v, 2)} %" for k, v in left.moves_percent.items() if v > 0.0])
    part = f"the part of the residual {torque} that depends on the {on}"
    size = f"{part} is {number(left.material_percent, 2)} % of the {torque}"
    return f"{size} and changes {moved} when it is fitted, which is allowed" if moved else f"{size}, which is allowed"
