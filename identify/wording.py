"""Numbers, units and names as a person reads them: shared by the terminal summary and the report."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

from identify.residual import FROM_RUN_TO_RUN, GAIN, Dependence
from identify.results import NORMAL_95, Errors, Identification, NotReported, ParameterEstimate

SYMBOLS = {
    "inertia": "J",
    "damping": "C",
    "stiffness": "K",
    "damping_over_inertia": "C/J",
    "stiffness_over_inertia": "K/J",
}
MAX_DIGITS = 7  # significant digits: torque and gyro scales are never calibrated better than 1e-6
TWO_DIGITS_UP_TO = 3.55  # leading digits of an uncertainty, rule of the Particle Data Group: 1.0 to 3.5 get two digits
SENTENCE_DIGITS = 4  # significant digits at most in a sentence; a table has all
MANY_TIMES = 3.0  # from here on a factor reads better than a percentage
_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:%|us|ms|s|Hz|kg·m²|N·m[·/²a-z]*|N|rad/s|rad|deg|m/s|kg|m)(?![\w·/]))")
_TITLES = {"rotary": "rotary inertia", "linear": "mass"}


def in_order(names: Iterable[str]) -> list[str]:
    """Each once, J, C and K in this order, then whatever else there is."""
    first = list(SYMBOLS)
    return sorted(dict.fromkeys(names), key=lambda name: first.index(name) if name in first else len(first))


def unit(text: str) -> str:
    """``N*m*s/rad`` as N·m·s/rad, ``kg*m^2`` as kg·m²."""
    return text.replace("*", "·").replace("^2", "²").replace("^3", "³")


def on_axis(text: str, axis: str) -> str:
    """The unit of a rotary axis as it is on ``axis``: ``N*m/rad`` as N/m on a linear one."""
    return text.replace("kg*m^2", "kg").replace("N*m", "N").replace("rad", "m") if axis == "linear" else text


def unbroken(text: str) -> str:
    """With its numbers and their units on one line: no line ends between them."""
    return _BEFORE_UNIT.sub("\u00a0", text)


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


def sentence(words: str) -> str:
    """With a capital at its beginning and a full stop at its end."""
    return f"{capital(words.rstrip(' .'))}." if words else ""


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


def readable(estimate: ParameterEstimate) -> ParameterEstimate:
    """A time below a tenth of a second in ms; all else as it is."""
    if estimate.unit != "s" or not 0.0 < abs(estimate.value) < 0.1:
        return estimate
    value, error, low, high = (1e3 * x for x in (estimate.value, estimate.std_error, *estimate.ci95))
    return replace(estimate, value=value, std_error=error, ci95=(low, high), unit="ms")


def _last_place(estimate: ParameterEstimate) -> int | None:
    """Power of ten of the last digit that half the 95 % interval supports; None without an interval."""
    half = half_interval(estimate)
    if not math.isfinite(half):
        half = NORMAL_95 * estimate.std_error
    if not (math.isfinite(estimate.value) and math.isfinite(half)) or half <= 0.0:
        return None
    order = math.floor(math.log10(half))
    place = order - 1 if half / 10.0**order < TWO_DIGITS_UP_TO else order
    return max(place, _order(estimate.value) - MAX_DIGITS + 1) if estimate.value else place


def _order(value: float) -> int:
    return math.floor(math.log10(abs(value)))


def _as_value(x: float, estimate: ParameterEstimate) -> str:
    """``x``, a bound or half an interval, with the last digit at the place of the estimate's."""
    place = _last_place(estimate)
    if place is None or not math.isfinite(x):
        return number(x)
    if not -5 <= max(_order(estimate.value) if estimate.value else place, place) < 7:
        return number(x, max(1, _order(x) - place + 1) if x else 1)
    return f"{round(x, -place) + 0.0:.{max(0, -place)}f}"  # + 0.0: no minus before a zero


def value_of(estimate: ParameterEstimate) -> str:
    """The value, with its last digit where the 95 % interval has its first or second."""
    return _as_value(estimate.value, estimate)


def value_in_sentence(estimate: ParameterEstimate) -> str:
    """The value as ``value_of`` has it, but with four digits at most."""
    shown = value_of(estimate)
    brief = number(_rounded(float(shown), SENTENCE_DIGITS), SENTENCE_DIGITS) if math.isfinite(estimate.value) else shown
    return min(brief, shown, key=len)


def half_of(estimate: ParameterEstimate) -> str:
    """Half the 95 % interval with the decimals of the value: the 0.00012 of 0.02030 ± 0.00012."""
    half = half_interval(estimate)
    shown = _as_value(half, estimate)
    return shown if half == 0.0 or not math.isfinite(half) or float(shown) else number(half, 2)


def interval_of(estimate: ParameterEstimate) -> str:
    """The 95 % interval with the decimals of the value: "0.01999 to 0.02001"."""
    low, high = (_as_value(bound, estimate) for bound in estimate.ci95)
    return f"{low} to {high}"


def half_interval(estimate: ParameterEstimate) -> float:
    """Half the width of the 95 % interval."""
    return 0.5 * (estimate.ci95[1] - estimate.ci95[0])


def with_interval(estimate: ParameterEstimate) -> str:
    """Value and half its 95 % interval, "0.02030 ± 0.00012"; both ends where they lie unevenly or are unbounded."""
    low, high = (abs(bound - estimate.value) for bound in estimate.ci95)
    if not (math.isfinite(low) and math.isfinite(high)) or abs(high - low) > 0.2 * max(high, low):
        return f"{value_of(estimate)} ({interval_of(estimate)})"
    return f"{value_of(estimate)} ± {half_of(estimate)}"


def printable(words: str) -> str:
    """Without control characters: a run's name must not steer the terminal."""
    return "".join(c if c.isprintable() else "?" for c in words)


def signed(value: float, digits: int = 4) -> str:
    """``digits`` significant digits behind a sign: "-215200", "+4.200"."""
    return f"{'+' if value > 0 else '-' if value < 0 else ''}{number(abs(value), digits)}"


def percent(value: float | None) -> str:
    """With a sign and two or three digits that matter: "+412 %", "-0.013 %", "+21200 %"."""
    if value is None or not math.isfinite(value):
        return "-"
    digits = 3 if abs(value) >= 10 else 2
    return f"{signed(_rounded(value, digits), digits)} %"


def _rounded(value: float, digits: int) -> float:
    """To significant digits also ahead of the point: 21206 to 21200."""
    return float(f"{value:.{digits - 1}e}")


def off_by(ratio: float) -> str:
    """How far a value is off, from it over the right one: "9.8 % too high", "about 16 times too high"."""
    if ratio < 0.0:
        return "of the wrong sign"
    if ratio >= MANY_TIMES:
        return f"about {number(_rounded(ratio, 2), 2)} times too high"
    off = 100.0 * (ratio - 1.0)
    return f"{percent(abs(off)).lstrip('+')} too {'high' if off > 0 else 'low'}"


def errors_by_model(identification: Identification) -> dict[str, Errors]:
    """What each model in turn leaves, all on the same samples, by what a table calls it.

    The declared one, the one from before a follow-up where one was played, the final one.
    """
    follow_up = identification.follow_up
    out = {"declared model": identification.before.error}
    if follow_up is not None and follow_up.error_without is not None:
        return out | {"without follow-up": follow_up.error_without, "after follow-up": identification.final.error}
    return out | ({"final model": identification.after.error} if identification.after else {})


def bias_percent(identification: Identification) -> dict[str, float]:
    """How far the declared model reads each of its parameters from where the final model has it, in percent."""
    if identification.after is None:
        return {}
    before, after = identification.before.parameters, identification.after.parameters
    shared = [name for name in before if name in after and after[name].value != 0.0]
    return {name: 100.0 * (before[name].value / after[name].value - 1.0) for name in shared}


def declared_number(identification: Identification, name: str, estimate: ParameterEstimate | None) -> str:
    """The number that somebody declared, with the digits that it was given with and in the unit of the row; else ""."""
    given = identification.declared.get(name)
    if given is None:
        return ""
    shown = estimate if estimate is None else readable(estimate)
    in_ms = estimate is not None and shown is not None and shown.unit != estimate.unit
    return f"{1e3 * given if in_ms else given:g}"


def frequency(value: float | None) -> str:
    """``0.5`` as "0.5 Hz"; a dash where a run has no frequency of its own."""
    return "-" if value is None else f"{value:g} Hz"


def not_said_yet(several: Sequence[NotReported], found: Identification) -> list[str]:
    """Parameters that stand in no table, with the reason, where neither the verdict nor the reasons say it already."""
    said = (*found.verdict.sentences, *found.reasons)
    return not_reported([item for item in several if not any(item.reason in sentence for sentence in said)])


def not_reported(several: Sequence[NotReported]) -> list[str]:
    """Parameters that stand in no table, with the reason, one sentence each."""
    return [capital(f"{plain(item.name.replace('.', ', '))}: {item.reason}") for item in several]


PULSATING = {"angle": "stiffness", "rate": "damping", "torque": GAIN}


def depends_on(quantity: str, axis: str) -> str:
    """What a torque depends on, in words: "angle" is "position" on a linear axis, "history" the past motion."""
    words = {"history": "past motion", "frequency": "frequency (spectral lines)"}
    words |= {"angle": "position", "rate": "speed", "torque": "force"} if axis == "linear" else {}
    return words.get(quantity, quantity)


def quantity_of(part: Dependence, axis: str) -> str:
    """The same of a part of the residual; what changes from run to run depends on the run.

    What a drive passes on depends on its load before, which is no history of the motion.
    """
    if part.changes == GAIN and part.on == "history":
        return "past force" if axis == "linear" else "past torque"
    return "run" if part.changes == FROM_RUN_TO_RUN else depends_on(part.on, axis)


def quantities_of(parts: Sequence[Dependence], axis: str) -> str:
    """The quantities that parts of the residual depend on, each once: "angle and direction"."""
    return joined(list(dict.fromkeys(quantity_of(d, axis) for d in parts)))


def contributes(times: float) -> bool:
    """Whether the held-out error is larger without an effect, by half a percent: what is less is read as none."""
    return not round(times, 2) <= 1.0


def without(times: float) -> str:
    """What an effect contributes: the held-out error without it over the one with it."""
    if not contributes(times):
        return "Without it, after refitting, the error on held-out data is no larger."
    percentage = f"{number(100.0 * (times - 1.0), 2)} % larger"
    more = percentage if times < MANY_TIMES else f"{number(times, 3)} times as large"
    return f"Without it, even after refitting, the error on held-out data is {more}."


def how_to_separate(how: str) -> str:
    """What separates an effect from its rivals, as part of a sentence: "what tells it from a delay: ..."."""
    return f"to distinguish it {how}" if how.startswith("from ") else f"to separate them: {how}"


def joined(words: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)
