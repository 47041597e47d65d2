"""The verdict in sentences: what was missing, how sure that is, what it did to J, C and K."""

from __future__ import annotations

from identify.bounds.advice import DETERMINED_RELATIVE_ERROR
from identify.conclude.acceptance import of_reported, opposite_signs
from identify.conclude.next_steps import to_determine, torque_free
from identify.residual import FROM_RUN_TO_RUN, Dependence, Disturbance
from identify.results import NORMAL_95, TAKEN_BACK, Identification
from identify.runs.measured_channels import REFUSED
from identify.runs.sign_convention import SENTENCE
from identify.select.evidence import WEIGHT
from identify.wording import (
    PULSATING,
    SYMBOLS,
    capital,
    half_interval,
    how_to_separate,
    joined,
    number,
    off_by,
    plain,
    quantities_of,
    quantity_of,
    readable,
    title,
    unit,
    value_in_sentence,
    with_interval,
    without,
)  # fmt: skip
from rig import effects

MAX_SHOWN_PARAMETERS = 4  # numbers of an effect in a sentence
MIN_SHOWN_PERCENT = 0.05  # a change below that is not worth a sentence


def sentences_of(found: Identification, damping_said: bool = False) -> tuple[str, ...]:
    """One finding a sentence, the most important first.

    ``damping_said``: another sentence says already why the damping is uncertain.
    """
    out: list[str] = [f"{capital(SENTENCE)}."] if not found.accepted and opposite_signs(found) else []
    for name in found.verdict.effects:
        out.append(_named(found, name))
    if not found.verdict.effects:
        why = "what was found may not be an effect of the platform." if found.verdict.left_open else ""
        out.append(
            "No effect is named: "
            + (why or _nothing_named(found))
        )  # fmt: skip
    out += [found.verdict.left_open] if found.verdict.left_open else []
    out += _parameter_bias(found)
    out += _exchangeable(found)
    if found.torque_scale is not None and "torque_scale" not in found.verdict.effects:
        scale = found.torque_scale
        off = abs(scale.value - 1.0) > NORMAL_95 * scale.std_error
        out.append(
            f"The known added inertia shows that the torque on the shaft is {with_interval(scale)} times the recorded "
            "torque"
            + ("; J, C and K are larger or smaller by the same factor." if off else ": the torque scale is right.")
        )
    out += _poorly_determined(found, damping_said)
    if found.disturbance is not None and _decided_in_torque(found):
        out.append(residual_torque_sentence(of_reported(found.disturbance, found.final), found.axis))
    elif found.verdict.unexplained:
        out.append(
            f"{number(100.0 * found.verdict.unexplained_fraction, 2)} % of the squared residual of the declared model, "
            f"sensor noise removed, is unexplained; {_what_it_depends_on(found)}."
        )
    if found.after is not None:
        out += [f"{capital(plain(d.name))} was dropped: {d.reason}." for d in found.after.dropped]
    refused = [c.status for c in found.verdict.candidates if c.status.startswith(REFUSED)]
    out += [f"Not considered as a cause: {status.removeprefix(REFUSED)}." for status in dict.fromkeys(refused)]
    for name in found.verdict.effects:
        read = effects.get(name).reads
        if read is not None and not read.nature.from_zero:
            out.append(
                f"{capital(plain(name))} is relative to {number(read.reference, 5)}: J, C and K are the values there."
            )
        elif read is not None and read.kind == "current":
            given = f"{number(read.factor, 5)} {'N of force' if found.axis == 'linear' else 'N m of torque'}"
            out.append(f"{capital(plain(read.name))}: one ampere gives {given}.")
    out += [
        f"{capital(joined([plain(n) for n in pair.split(' / ')]))} cannot be separated: {why}."
        for pair, why in found.verdict.never_separable.items()
    ]
    return tuple(out)


def _what_it_depends_on(found: Identification) -> str:
    """As the acceptance has it, which looked at the torque that is left; the plots where it did not."""
    left = found.disturbance
    if not found.accepted or left is None:
        return "the plots show what it depends on"
    on = quantities_of(left.depends_on, found.axis)
    return f"it depends on the {on}" if on else "it depends on no quantity that was tested"


def _decided_in_torque(found: Identification) -> bool:
    return found.final.error.holdout_measure == "holdout_torque_relative"


def _nothing_named(found: Identification) -> str:
    """Why no effect is named."""
    back = list(dict.fromkeys(plain(c.effect) for c in found.verdict.candidates if c.status == TAKEN_BACK))
    if back and (_decided_in_torque(found) or found.verdict.unexplained):
        return (
            f"{joined(back)} explained part of the residual, but no better than an arbitrary curve or a model with "
            "fewer terms."
        )
    if _decided_in_torque(found):
        torque = "force" if found.axis == "linear" else "torque"
        return f"every candidate explains less than {100.0 * WEIGHT:.0f} % of the residual {torque}."
    if found.verdict.unexplained:
        return "no candidate explains the residual."
    return "the declared model already reaches the noise floor."


def _poorly_determined(found: Identification, damping_said: bool) -> list[str]:
    """J, C and K that are given and yet say little, with what would tell more."""
    given = found.final.parameters
    wide = [name for name, p in given.items() if p.value and p.std_error > DETERMINED_RELATIVE_ERROR * abs(p.value)]
    wide = [name for name in wide if not (damping_said and name == "damping")]
    if not wide or not found.accepted:
        return []  # what else is wrong comes first
    each = [
        f"{title(n, found.axis)} ± {number(100.0 * half_interval(given[n]) / abs(given[n].value), 2)} %" for n in wide
    ]
    return [f"Poorly determined: {joined(each)}. {to_determine(wide, torque_free(found))}"]


def _named(found: Identification, name: str) -> str:
    values = (found.after or found.before).effect_parameters.get(name, {})
    ordered = sorted(values.items(), key=lambda item: "_run_" in item[0])  # what every run has of its own comes last
    shown = {k.replace("_", " "): readable(v) for k, v in ordered[:MAX_SHOWN_PARAMETERS]}
    numbers = ", ".join(f"{k} {value_in_sentence(v)} {unit(v.unit)}".removesuffix(" 1") for k, v in shown.items())
    rivals = found.verdict.confusable_with.get(name, ())
    text = f"The model lacked {plain(name)} ({numbers})."
    if name in found.verdict.contribution:
        text += f" {without(found.verdict.contribution[name])}"
    if rivals:
        separate = effects.get(name).separated_by
        text += f" These data cannot exclude {' or '.join(plain(r) for r in rivals)}"
        text += f"; {how_to_separate(separate)}." if separate else "."
    return text


def _parameter_bias(found: Identification) -> list[str]:
    """What the change of the model did to each parameter, in one sentence that names the change."""
    if found.after is None or (found.verdict.unexplained and not found.verdict.effects):
        return []  # of two wrong models neither says what the other did
    moved = []
    for name, before in found.before.parameters.items():
        after = found.after.parameters.get(name)
        if after is None or after.value == 0.0:
            continue
        ratio = before.value / after.value
        if abs(100.0 * (ratio - 1.0)) >= MIN_SHOWN_PERCENT:
            moved.append(f"{title(name, found.axis)} is {off_by(ratio)}")
    return [f"{_change(found)}, {joined(moved)}."] if moved else []


def _exchangeable(found: Identification) -> list[str]:
    """That of two low-passes in a row nobody knows which is the platform, where nothing bends the motion.

    Said where the slower of the two is reported as the lag; the other way round is what anybody expects.
    """
    lags = [e for e in found.final.effect_parameters if effects.get(e).is_first_order_lag]
    other = [e for e in found.final.effect_parameters if e not in lags and not effects.get(e).is_constant]
    inertia, damping = (found.final.parameters.get(term) for term in ("inertia", "damping"))
    if torque_free(found) or len(lags) != 1 or other or "stiffness" in found.final.parameters:
        return []
    if inertia is None or damping is None or min(inertia.value, damping.value) <= 0.0:
        return []
    late = found.final.effect_parameters[lags[0]].get("time")  # none where the runs do not determine it
    if late is None or late.value < inertia.value / damping.value:
        return []
    return [
        f"Without a spring, inertia over damping and the time of {plain(lags[0])} may be exchanged: "
        f"{title('inertia', found.axis)} of "
        f"{number(damping.value * late.value, 3)} {unit(inertia.unit)} beside a lag of "
        f"{number(1e3 * inertia.value / damping.value, 3)} ms fits as well. Check the declared inertia: nothing "
        "else tells which."
    ]


def _change(found: Identification) -> str:
    """The model as declared against the final one: "Without Coulomb friction and torque delay"."""
    added = [plain(name) for name in found.verdict.effects]
    if added:
        return f"Without {joined(added)} in the model"
    before = {*found.before.parameters, *found.before.effect_parameters}
    dropped = [plain(item.name) for item in found.after.dropped if item.name in before] if found.after else []
    return f"With {joined(dropped)} in the model" if dropped else "In the model as declared"


def residual_torque_sentence(left: Disturbance, axis: str) -> str:
    """What is left after the final model, in one sentence: how large a torque, and what it goes with."""
    torque = "force" if axis == "linear" else "torque"
    share = f"{number(100.0 * left.relative, 2)} % of the {torque}"
    size = f"{number(left.torque_rms, 2)} {unit(left.unit)} rms, sensor noise removed ({share})"
    if not left.depends_on:
        return (
            f"The final model leaves a residual {torque} of {size}. It depends on no quantity that was tested, so it "
            "counts as noise and is included in the intervals."
        )
    parts = [(d.relative, quantity_of(d, axis), _how(d, left.unit)) for d in left.depends_on]
    each = joined([f"{number(100.0 * part, 2)} % depends on the {quantity}{how}" for part, quantity, how in parts])
    moved = joined([f"{SYMBOLS[k]} by {number(v, 2)} %" for k, v in left.moves_percent.items() if v > 0.0])
    change = f" Fitting this part too changes {moved}." if moved else ""
    return f"The final model leaves a residual {torque} of {size}. Of the {torque}, {each}.{change}"


def _how(part: Dependence, of_torque: str) -> str:
    """Of what changes as a wave: what, and how fast; of what changes with a quantity: what; of steps: their size."""
    if part.step_nm is not None:
        return f", as if the drive gave it in steps of {number(part.step_nm, 3)} {unit(of_torque)}"
    if part.changes == FROM_RUN_TO_RUN:
        return " (J, C and K fitted to each run by itself differ)"
    if part.changes:
        return f" (as if the {part.changes} changed with it)"
    if part.wave_hz is None:
        return ""
    return f", as if something changed the {PULSATING[part.wave_on]} at {number(part.wave_hz, 3)} Hz"
