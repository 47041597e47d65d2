"""What two results have in common and in what they differ, section by section, in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from identify.report.comparison.errors import disturbance_section, error_section
from identify.report.comparison.numbers import ABSENT, Change, change_of, one_sided
from identify.report.comparison.saved import SavedNumber, SavedResult
from identify.report.comparison.section import Section
from identify.wording import capital, plain, sentence, title
from rig.platform import TERMS

RULE = "Beyond both: the change is larger than each 95 % interval, and the two intervals do not overlap."


@dataclass(frozen=True)
class _Line:
    """A parameter of either model: what it is called, where result.json lists it, and its two numbers."""

    words: str
    name: str  # "stiffness", or "stribeck_friction.speed"
    effect: str  # empty for J, C, K
    a: SavedNumber | None
    b: SavedNumber | None


def compare(a: SavedResult, b: SavedResult, names: tuple[str, str]) -> tuple[Section, ...]:
    """All that changed from A to B; ``names`` are those of the folders."""
    parameters, changed = _parameters(a, b)
    return (
        _overview(a, b, names, changed),
        parameters,
        _effects(a, b),
        error_section(a, b),
        disturbance_section(a, b),
    )


def _overview(a: SavedResult, b: SavedResult, names: tuple[str, str], changed: list[str]) -> Section:
    rows = [
        ("folder", *names),
        ("outcome", _outcome(a), _outcome(b)),
        ("axis", a.axis, b.axis),
        ("effects named", _named(a), _named(b)),
    ]
    if a.axis != b.axis:
        first = "One axis is rotary and the other linear: their quantities differ in kind and are not compared."
    elif changed:
        first = f"Changed by more than both intervals: {'; '.join(changed)}."
    else:
        first = "No parameter that both have changed by more than both intervals."
    notes = [first]
    for letter, one in (("A", a), ("B", b)):
        if one.aborted:
            notes.append(f"{letter} was stopped: its numbers are those of the samples recorded before.")
        if one.is_torque_free and not (a.is_torque_free and b.is_torque_free):
            notes.append(
                f"{letter} has no torque, so only ratios to the inertia are known: C/J and K/J cannot be "
                "compared with J, C and K."
            )
        notes += [f"{letter} was not accepted: {sentence(reason)}" for reason in one.reasons if not one.accepted]
    return Section("Comparison", ("", "A", "B"), tuple(rows), tuple(notes), words=(0, 1, 2))


def _outcome(one: SavedResult) -> str:
    if one.aborted:
        return "aborted"
    return "accepted" if one.accepted else "not accepted"


def _named(one: SavedResult) -> str:
    return ", ".join(plain(name) for name in one.verdict.effects) or "none"


def _parameters(a: SavedResult, b: SavedResult) -> tuple[Section, list[str]]:
    """The table of all parameters, and those that changed by more than both intervals."""
    rows, notes, changed = [], [], []
    for line in _lines(a, b):
        change, why = _change(line, a, b)
        rows.append((line.words, change.a, change.b, change.difference, change.relative, change.is_larger, change.unit))
        notes += why
        if change.is_larger == "yes":
            changed.append(f"{line.words} ({change.relative})" if change.relative != ABSENT else line.words)
    if set(a.final.effect_parameters) != set(b.final.effect_parameters):
        notes.append(
            "The two models have different effects: a change of J, C or K may be due to an effect that only one of "
            "them includes."
        )
    head = ("", "A", "B", "B - A", "of A", "beyond both", "unit")
    found = Section("Parameters of the final models, with 95 % intervals", head, tuple(rows), (RULE, *notes), (0, 6))
    return found, changed


def _lines(a: SavedResult, b: SavedResult) -> Iterator[_Line]:
    one, two = a.final, b.final
    absent = {i.name: None for m in (one, two) for i in (*m.dropped, *m.not_determined) if "." not in i.name}
    for name in dict.fromkeys((*one.parameters, *two.parameters)):
        yield _Line(title(name, a.axis), name, "", one.parameters.get(name), two.parameters.get(name))
        absent.pop(name, None)
    for effect in dict.fromkeys((*one.effect_parameters, *two.effect_parameters)):
        first, last = one.effect_parameters.get(effect, {}), two.effect_parameters.get(effect, {})
        for name in dict.fromkeys((*first, *last)):
            words = f"{plain(effect)}, {name.replace('_', ' ')}"
            yield _Line(words, f"{effect}.{name}", effect, first.get(name), last.get(name))
    for name in absent:  # on neither side: dropped on one and not determined on the other, or on both
        yield _Line(title(name, a.axis) if name in TERMS else plain(name), name, "", None, None)


def _change(line: _Line, a: SavedResult, b: SavedResult) -> tuple[Change, list[str]]:
    notes = []
    for letter, result, given in (("A", a, line.a), ("B", b, line.b)):
        word, reason = result.final.absence(line.name)
        if given is None and word:
            notes.append(f"{capital(line.words)} is {word} in {letter}: {sentence(reason)}")
    words = [_absent(line, one) for one in (a, b)]
    if line.a is None and line.b is None:
        return Change(words[0], words[1], ABSENT, ABSENT, "in neither", ""), notes
    if line.a is None or line.b is None:
        letter = "B" if line.a is None else "A"
        return one_sided(line.a, line.b, words[0] if line.a is None else words[1], f"only in {letter}"), notes
    if a.axis != b.axis and line.a.unit == line.b.unit:
        return _of_other_axes(line.a, line.b), notes
    return change_of(line.a, line.b), notes


def _of_other_axes(a: SavedNumber, b: SavedNumber) -> Change:
    """Two numbers of different axes whose units happen to be equal (1/s): shown, never compared."""
    found = change_of(a, b)
    return Change(found.a, found.b, ABSENT, ABSENT, "other axis", found.unit)


def _absent(line: _Line, one: SavedResult) -> str:
    word, _ = one.final.absence(line.name)
    if word:
        return word
    if line.effect:
        return "not in the model" if line.effect not in one.final.effect_parameters else "not reported"
    return "per inertia only" if one.is_torque_free and line.name in TERMS else "not in the model"


def _effects(a: SavedResult, b: SavedResult) -> Section:
    names = dict.fromkeys(
        (*a.verdict.effects, *b.verdict.effects, *a.final.effect_parameters, *b.final.effect_parameters)
    )
    rows = [(plain(name), _status(name, a), _status(name, b)) for name in names]
    notes = [*_perhaps_the_same("A", a, "B", b), *_perhaps_the_same("B", b, "A", a)]
    if not rows:
        notes.append("Neither model has effects beside J, C and K.")
    return Section("Effects", ("", "A", "B"), tuple(rows), tuple(notes), (0, 1, 2))


def _status(name: str, one: SavedResult) -> str:
    if name in one.verdict.effects:
        rivals = one.verdict.confusable_with.get(name, ())
        return "named" + (f", or {' or '.join(plain(r) for r in rivals)}" if rivals else "")
    if name in one.final.effect_parameters:
        return "declared"
    if any(i.name.partition(".")[0] == name for i in one.final.dropped):
        return "dropped"
    tried = [c.status for c in one.verdict.candidates if c.effect == name]
    return f"tried: {tried[-1]}" if tried else "not tried"


def _perhaps_the_same(letter: str, one: SavedResult, other_letter: str, other: SavedResult) -> list[str]:
    """Effects of one result that the other names differently because its data cannot tell the two apart."""
    return [
        f"{letter} names {plain(name)}, {other_letter} names {plain(rival)}, and the data of {other_letter} cannot "
        "tell the two apart: they may be the same."
        for name in one.verdict.effects
        if name not in other.verdict.effects
        for rival in other.verdict.effects
        if name in other.verdict.confusable_with.get(rival, ())
    ]
