"""What runs can and cannot determine, in words that a bench engineer acts on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.bounds.cramer_rao import DELAY, Information, together
from identify.estimate.own_delays import DELAY_NAME
from identify.model.parameters import Name
from identify.results import NORMAL_95
from identify.wording import SYMBOLS, joined, number, plain
from rig import effects
from rig.platform import TERMS

DETERMINED_RELATIVE_ERROR = 0.05  # relative standard error up to which a parameter counts as determined
POOR_CONDITION = 100.0  # condition number of the scaled sensitivities, 1 at best; set by hand
AIMED_STD_ERROR = 0.01  # relative standard error that advice on the torque aims at
SEPARATE = 200.0  # amplification of the model's errors beyond which inertia and stiffness cannot be separated
_RATIOS = {("damping",): "C/J", ("stiffness",): "K/J"}


def undetermined_sentence(name: str, missing: Sequence[str], partner: str | None = None) -> str:
    """Advice on a run that alone does not determine some terms; ``partner`` is a run that it should be fitted with.

    >>> undetermined_sentence("0.5 Hz", ["inertia", "stiffness"], "6 Hz")
    '0.5 Hz alone cannot separate inertia from stiffness: keep the start transient or fit it with 6 Hz'
    """
    beside = f"fit it with {partner}" if partner else "fit it together with a set at another frequency"
    if {"inertia", "stiffness"} <= set(missing):
        return f"{name} alone cannot separate inertia from stiffness: keep the start transient or {beside}"
    return f"{name} alone does not determine {joined(missing)}: keep the start transient or {beside}"


def label(name: Name, torque_free: bool = False) -> str:
    """J, C, K (C/J, K/J without torque), "Coulomb friction level"."""
    if len(name) == 1:
        return _RATIOS[name] if torque_free else SYMBOLS[name[0]]
    run = f" of run {int(name[2]) + 1}" if len(name) == 3 else ""
    return f"{plain(name[0])} {name[1]}{run}" if name[0] != DELAY else "torque delay"


def expected(information: Information) -> str:
    """Expected standard errors: "J ± 0.0024 %, C ± 0.023 %, K ± 0.0024 %"; one above the value determines nothing."""
    each = []
    for name in information.names:
        value, error = abs(information.values[information.names.index(name)]), information.std_error(name)
        words = label(name, information.torque_free)
        if not np.isfinite(error) or 0.0 < value < error:
            each.append(f"{words} not determined")
        elif value == 0.0:
            each.append(f"{words} ± {_amount(error, _unit(name))} (declared as 0)")
        else:
            each.append(f"{words} ± {number(100.0 * error / value, 2)} %")
    return ", ".join(each)


def _amount(value: float, unit: str) -> str:
    """Two digits and the unit; times in microseconds."""
    return f"{number(1e6 * value, 2)} us" if unit == "s" else f"{number(value, 2)} {unit}"


def _unit(name: Name) -> str:
    if len(name) == 1:
        return {"inertia": "kg m^2", "damping": "N m s/rad", "stiffness": "N m/rad"}[name[0]]
    return next(p.unit for p in effects.get(name[0]).parameters if p.name == name[1]).replace("*", " ")


def weak(information: Information) -> list[Name]:
    """Parameters that are not determined: too uncertain, or for J and K, moved at will by errors of the model."""
    out = []
    for i, name in enumerate(information.names):
        if information.values[i] == 0.0:
            if not np.isfinite(information.std_error(name)):
                out.append(name)
        elif information.relative(name) > DETERMINED_RELATIVE_ERROR or _entangled(information, name):
            out.append(name)
    return out


def _entangled(information: Information, name: Name) -> bool:
    pair = {("inertia",), ("stiffness",)}
    if name not in pair or not pair <= set(information.names) or information.torque_free:
        return False
    stiffness = information.values[information.names.index(("stiffness",))]
    return bool(stiffness != 0.0 and max(information.amplification(n) for n in pair) > SEPARATE)


def below_noise(information: Information) -> bool:
    """Whether the motion is quieter than the sensor and nothing that is not zero comes out well."""
    errors = [information.relative(n) for i, n in enumerate(information.names) if information.values[i] != 0.0]
    return information.loudness < 1.0 and all(e > DETERMINED_RELATIVE_ERROR for e in errors)


def of_set(information: Information, others: Sequence[Information] = ()) -> str:
    """One sentence on one set; ``others`` are the sets that it could be fitted with."""
    i = information
    if i.torque_free:
        ratios = f"a decay without torque determines only ratios; expected {expected(i)}"
        return f"{i.name}: {ratios}. Record the torque to get J, C and K"
    if below_noise(i):
        worst = max(i.relative(n) for k, n in enumerate(i.names) if i.values[k] != 0.0)
        motion = f"the motion is {number(i.loudness, 2)} times the sensor's noise: too small to determine anything"
        cure = (
            f"about {number(worst / AIMED_STD_ERROR, 2)} times the torque would give {100 * AIMED_STD_ERROR:g} %"
            if worst < 1e6
            else "raise the torque"
        )
        return f"{i.name}: below the noise: {motion} ({expected(i)}); {cure}"
    if not weak(i):
        return f"{i.name}: expected {expected(i)}{_detection_limits(i)}"
    return f"{of_weak_set(i, others)} (expected {expected(i)}){_detection_limits(i)}"


def of_weak_set(information: Information, others: Sequence[Information] = ()) -> str:
    """What a set alone does not determine, and which other set it should be fitted with."""
    missing = weak(information)
    terms = [n[0] for n in missing if n[0] in TERMS]
    if not terms:
        return f"{information.name} alone does not determine every effect"
    sentence = undetermined_sentence(information.name, terms, _partner(information, missing, others))
    rest = [label(n) for n in missing if n[0] not in TERMS]
    return sentence + (f"; add a set for {joined(rest)}" if rest else "")


def _detection_limits(information: Information) -> str:
    bounds = ""
    for k, name in enumerate(information.names):
        if information.values[k] == 0.0 and name in {("damping",), ("stiffness",)}:
            least = NORMAL_95 * information.std_error(name)
            if np.isfinite(least):
                bound = f"{number(least, 2)} {_unit(name)}"
                bounds += f"; {name[0]} is declared as 0; a value below {bound} cannot be distinguished from 0"
    return bounds


def _partner(information: Information, missing: Sequence[Name], others: Sequence[Information]) -> str | None:
    """The other set beside which all that is missing here is determined best; none where no set does."""
    best, found = np.inf, None
    for other in others:
        if other.name == information.name or other.names != information.names or other.torque_free:
            continue
        both = information + other
        left = weak(both)
        worst = max(both.relative(n) for n in missing)
        if not any(n in left for n in missing) and worst < best:
            best, found = worst, other.name
    return found


def of_campaign(each: Sequence[Information]) -> str:
    """One sentence on all sets together."""
    total = together(each)
    if total.torque_free:
        return (
            f"all sets together: expected {expected(total)}. Without torque, J, C and K themselves stay unknown: "
            "record the torque, or repeat the decay with a known added inertia"
        )
    line = f"all sets together: expected {expected(total)}{_detection_limits(total)}; {_figures(total)}"
    missing = weak(total)
    if missing:
        line += f"; NOT determined: {joined([label(n) for n in missing])}. {cure(total)}"
    return line


def _figures(total: Information) -> str:
    """Whether all are determined, the condition and the strongest correlation."""
    p = len(total.names)
    condition = f"condition number {number(total.condition, 2)}; above {POOR_CONDITION:g} is poor"
    if weak(total):
        figures = f"the data determine {total.rank} of {p} independent combinations of the parameters ({condition})"
    else:
        figures = f"{f'all {p} parameters are' if p > 1 else 'the parameter is'} determined ({condition})"
    if p < 2:
        return figures
    size = np.abs(total.correlation - np.eye(p))
    i, k = np.unravel_index(int(np.argmax(size)), size.shape)
    names = f"{label(total.names[min(i, k)])} and {label(total.names[max(i, k)])}"
    return f"{figures}, strongest correlation {number(float(total.correlation[i, k]), 3)} ({names})"


def cure(total: Information) -> str:
    """What to add to a campaign that leaves something open."""
    missing = weak(total)
    if below_noise(total):
        return "Raise the torque."
    if ("inertia",) in missing and ("stiffness",) in missing:
        return "Add a set at another frequency, or start a set abruptly (soft_start_s: 0) so that the platform rings."
    return "Add a set at another frequency, a multisine, or more torque."


def of_delay(each: Sequence[Information]) -> str:
    """Whether a torque delay, which every record may hold, can be separated from damping; ``each`` with the delay."""
    total, damping = together(each), ("damping",)
    if total.torque_free or DELAY_NAME not in total.names or damping not in total.names:
        return ""
    if damping in weak(total.without(DELAY_NAME)):
        return ""  # that damping is not determined has been said
    error = total.std_error(DELAY_NAME)
    bent = total.relative(damping)
    if below_noise(total):
        return ""
    if not np.isfinite(error) or bent > DETERMINED_RELATIVE_ERROR:
        return (
            "a torque delay cannot be separated from damping here, and an undeclared delay biases C: "
            "add sets at other frequencies, or one that starts abruptly"
        )
    return f"if the delay is also fitted: delay ± {number(1e6 * error, 2)} us, C ± {number(100 * bent, 2)} %"
