"""Numbers, units and names as a person reads them: shared by the terminal summary and the report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from identify.results import Disturbance, Errors, Identification, NotReported, ParameterEstimate

SYMBOLS = {
    "inertia": "J",
    "damping": "C",
    "stiffness": "K",
    "damping_over_inertia": "C/J",
    "stiffness_over_inertia": "K/J",
}
UNCHANGED_PERCENT = 1e-6
_TITLES = {"rotary": "rotary inertia", "linear": "mass"}


def unit(text: str) -> str:
    """``N*m*s/rad`` as N·m·s/rad, ``kg*m^2`` as kg·m²."""
    return text.replace("*", "·").replace("^2", "²").replace("^3", "³")


def title(name: str, axis: str) -> str:
    """``inertia`` as "rotary inertia J", or "mass J" on a linear axis."""
    words = _TITLES[axis] if name == "inertia" else name.replace("_", " ")
    return f"{words} {SYMBOLS[name]}" if name in SYMBOLS else words


def plain(name: str) -> str:
    """``coulomb_friction`` as "Coulomb friction"."""
    words = name.replace("_", " ")
    for person in ("coulomb", "stribeck"):
        words = words.replace(person, person.capitalize())
    return words


def capital(words: str) -> str:
    """With a capital to begin the sentence; what stands behind it is left alone."""
    return words[:1].upper() + words[1:]


def number(value: float | None, digits: int = 4) -> str:
    """``digits`` significant digits without an exponent where that stays short; a dash for None or NaN."""
    if value is None or math.isnan(value):
        return "-"
    if math.isinf(value):
        return "unbounded"
    if value == 0.0:
        return "0"
    order = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -5 <= order < 7:
        return f"{value:.{max(0, digits - 1 - order)}f}"
    return f"{value:.{digits - 1}e}"


def digits_for(value: float, uncertainty: float) -> int:
    """Significant digits of ``value`` that show two of its uncertainty: between 3 and 9."""
    if not (math.isfinite(value) and math.isfinite(uncertainty)) or value == 0.0 or uncertainty <= 0.0:
        return 4
    return min(9, max(3, math.floor(math.log10(abs(value))) - math.floor(math.log10(uncertainty)) + 2))


def readable(estimate: ParameterEstimate) -> ParameterEstimate:
    """A time below a tenth of a second in ms; all else as it is."""
    if estimate.unit != "s" or not 0.0 < abs(estimate.value) < 0.1:
        return estimate
    low, high = estimate.ci95
    return replace(
        estimate,
        value=1e3 * estimate.value,
        std_error=1e3 * estimate.std_error,
        ci95=(1e3 * low, 1e3 * high),
        unit="ms",
    )


def value_of(estimate: ParameterEstimate) -> str:
    """The value with as many digits as its standard error deserves."""
    return number(estimate.value, digits_for(estimate.value, estimate.std_error))


def interval_of(estimate: ParameterEstimate) -> str:
    """The 95 % interval with the decimals of the value: "0.01999 to 0.02001"."""
    shown = value_of(estimate)
    decimals = len(shown.partition(".")[2])
    if "e" in shown or not all(math.isfinite(bound) for bound in estimate.ci95):
        digits = digits_for(estimate.value, estimate.std_error)
        low, high = (number(bound, digits) for bound in estimate.ci95)
        return f"{low} to {high}"
    return f"{estimate.ci95[0]:.{decimals}f} to {estimate.ci95[1]:.{decimals}f}"


def half_interval(estimate: ParameterEstimate) -> float:
    """Half the width of the 95 % interval."""
    return 0.5 * (estimate.ci95[1] - estimate.ci95[0])


def with_interval(estimate: ParameterEstimate) -> str:
    """Value and half its 95 % interval, "0.02030 ± 0.00012"; both ends where they lie unevenly or are unbounded."""
    low, high = (abs(bound - estimate.value) for bound in estimate.ci95)
    if not (math.isfinite(low) and math.isfinite(high)) or abs(high - low) > 0.2 * max(high, low):
        return f"{value_of(estimate)} ({interval_of(estimate)})"
    return f"{value_of(estimate)} ± {number(half_interval(estimate), 2)}"


def printable(words: str) -> str:
    """Without control characters: a run's name must not steer the terminal."""
    return "".join(c if c.isprintable() else "?" for c in words)


def percent(value: float | None) -> str:
    """With a sign and two or three digits that matter: "+412 %", "-0.013 %"."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{'+' if value > 0 else '-' if value < 0 else ''}{number(abs(value), 3 if abs(value) >= 10 else 2)} %"


def errors_in_turn(identification: Identification) -> dict[str, Errors]:
    """What each model in turn leaves, all on the same samples, by what a table calls it.

    The declared one, the one from before a follow-up where one was played, the final one.
    """
    follow_up = identification.follow_up
    out = {"declared model": identification.before.error}
    if follow_up is not None and follow_up.error_without is not None:
        return out | {
            "without follow-up": follow_up.error_without, "after follow-up": identification.final.error
        }  # fmt: skip
    return out | ({"final model": identification.after.error} if identification.after else {})


def bent_percent(identification: Identification) -> dict[str, float]:
    """How far the declared model reads each of its parameters from where the final model has it, in percent."""
    if identification.after is None:
        return {}
    before, after = identification.before.parameters, identification.after.parameters
    shared = [name for name in before if name in after and after[name].value != 0.0]
    return {name: 100.0 * (before[name].value / after[name].value - 1.0) for name in shared}


def bent_sentences(identification: Identification) -> list[str]:
    """What the missing effects did to each parameter of the declared model, largest first, one sentence each."""
    bent = sorted(bent_percent(identification).items(), key=lambda item: -abs(item[1]))
    said = []
    for name, off in bent:
        if abs(off) < UNCHANGED_PERCENT:
            said.append(f"{capital(title(name, identification.axis))}: unchanged by the added effects.")
            continue
        before, after = (model.parameters[name] for model in (identification.before, identification.final))
        within = abs(before.value - after.value) <= 2.0 * math.hypot(before.std_error, after.std_error)
        size = percent(abs(off)).lstrip("+")
        note = " (within its uncertainty)" if within else ""
        way = "high" if off > 0 else "low"
        said.append(
            f"{capital(title(name, identification.axis))}: "
            f"fitted without the missing effects it is {size} too {way}{note}."
        )
    return said


def frequency(value: float | None) -> str:
    """``0.5`` as "0.5 Hz"; a dash where a run has no frequency of its own."""
    return "-" if value is None else f"{value:g} Hz"


def pairs(several: Mapping[str, Sequence[str]]) -> list[str]:
    """What a name can be confused with, one sentence each; names without a rival are left out."""
    return [
        capital(f"{' or '.join(plain(r) for r in rivals)} explains these data about as well as {plain(name)}.")
        for name, rivals in several.items()
        if rivals
    ]


def not_reported(several: Sequence[NotReported]) -> list[str]:
    """Parameters that stand in no table, with the reason, one sentence each."""
    return [capital(f"{plain(item.name.replace('.', ', '))}: {item.reason}") for item in several]


def left_over(left: Disturbance, axis: str) -> str:
    """What is left after the final model, in one sentence: how large a torque, and what it goes with."""
    torque = "force" if axis == "linear" else "torque"
    size = f"{number(left.torque_rms, 2)} {unit(left.unit)} rms, {number(100.0 * left.relative, 2)} % of the {torque}"
    if not left.depends_on:
        return (
            f"What is left is a {torque} of {size}; it depends on nothing that was tried: noise, and in the intervals."
        )
    each = joined([f"{number(100.0 * d.relative, 2)} % with the {d.on}" for d in left.depends_on])
    moved = joined([f"{SYMBOLS[k]} by {number(v, 2)} %" for k, v in left.moves_percent.items()])
    told = f" A free-form term of that beside the model moves {moved}." if moved else ""
    return f"What is left is a {torque} of {size}; part of it goes with something: {each}.{told}"


def without(times: float) -> str:
    """What an effect contributes: the held-out error without it over the one with it."""
    return f"Without it, even after refitting, the error on held-out data is {number(times, 3)} times larger."


def told_apart(how: str) -> str:
    """What separates an effect from its rivals, as part of a sentence: "what tells it from a delay: ..."."""
    return f"to distinguish it {how}" if how.startswith("from ") else f"to separate them: {how}"


def joined(words: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)
