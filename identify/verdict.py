"""The verdict in sentences: what was missing, how sure that is, what it did to J, C and K."""

from __future__ import annotations

from identify.results import Identification
from identify.wording import capital, number, plain, title, unit, value_of
from rig import effects


def sentences_of(found: Identification) -> tuple[str, ...]:
    """One finding a sentence, the most important first."""
    out: list[str] = []
    for name in found.verdict.effects:
        out.append(_named(found, name))
    if not found.verdict.effects:
        out.append(
            "No effect is named: "
            + ("none of those known explains the residual." if found.verdict.unexplained
               else "the declared model reaches the noise floor.")
        )  # fmt: skip
    out += _bent(found)
    if found.verdict.unexplained:
        out.append(
            f"{number(100.0 * found.verdict.unexplained_fraction, 2)} % of the residual above the noise floor stays "
            "unexplained; the plots show what it depends on."
        )
    if found.after is not None:
        out += [f"{capital(plain(d.name))} was left out of the refit: {d.reason}." for d in found.after.dropped]
    out += [f"{pair} cannot be told apart: {why}." for pair, why in found.verdict.never_separable.items()]
    return tuple(out)


def _named(found: Identification, name: str) -> str:
    values = (found.after or found.before).effect_parameters.get(name, {})
    numbers = ", ".join(f"{k.replace('_', ' ')} {value_of(v)} {unit(v.unit)}" for k, v in list(values.items())[:4])
    rivals = found.verdict.confusable_with.get(name, ())
    text = f"The model lacked {plain(name)} ({numbers})."
    if rivals:
        separate = effects.get(name).separated_by
        text += f" These data cannot exclude {' or '.join(plain(r) for r in rivals)}"
        text += f"; to separate: {separate}." if separate else "."
    return text


def _bent(found: Identification) -> list[str]:
    if found.after is None:
        return []
    out = []
    for name, before in found.before.parameters.items():
        after = found.after.parameters.get(name)
        if after is None or after.value == 0.0:
            continue
        percent = 100.0 * (before.value / after.value - 1.0)
        if abs(percent) >= 0.05:
            out.append(
                f"Without it, {title(name, found.axis)} came out {number(abs(percent), 3)} % too "
                f"{'high' if percent > 0 else 'low'}."
            )
    return out
