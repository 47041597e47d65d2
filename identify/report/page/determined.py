"""The Cramer-Rao bound compared with the standard error reached, set by set and together."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from identify.bounds.advice import POOR_CONDITION
from identify.bounds.bound_and_estimate import BoundComparison
from identify.report.page.markup import Markup, Piece, element, join, table
from identify.wording import SYMBOLS, capital, number

RATIOS = {"damping": "damping_over_inertia", "stiffness": "stiffness_over_inertia"}


def determined_table(comparisons: Sequence[BoundComparison], remarked: Collection[str] = ()) -> Markup:
    """Rank, condition, bound and standard error of each parameter, and what follows; nothing without entries.

    ``remarked`` are the sets of which the table of the sets says already what they do not determine.
    """
    if not comparisons:
        return Markup("")
    names = list(dict.fromkeys(n for one in comparisons for n in one.expected))
    ratios = "inertia" not in names
    symbols = [SYMBOLS[RATIOS[n]] if ratios else SYMBOLS[n] for n in names]
    head: list[Piece] = ["set", "rank", "condition number"]
    head += [join([symbol, element("small", " bound / reached (%)")]) for symbol in symbols]
    rows: list[list[Piece]] = []
    for one in comparisons:
        row: list[Piece] = [one.name, f"{one.rank} of {one.parameters}", _condition(one.condition)]
        row += [_pair(one.expected.get(n), one.achieved.get(n)) for n in names]
        rows.append([*row, "" if one.name in remarked else capital(one.sentence)])
    caption = (
        "One standard error, in percent of the value. Bound: the Cramer-Rao bound for the sensor's noise, the "
        "recorded samples and the identified values (initial state and bias unknown; for a single set, effects "
        "known). Reached: the reported standard error. Rank: number of parameter combinations that the data "
        "determine. Condition number: 1 is best; above "
        f"{POOR_CONDITION:g}, a small error of the model shifts one parameter against another. Limited by sensor "
        "noise: more torque, a longer record or a quieter sensor would narrow the interval."
    )
    return table([*head, "conclusion"], rows, caption, words=(len(head),))


def _condition(value: float) -> str:
    return number(value, 2) if np.isfinite(value) else "singular"


def _pair(bound: float | None, reached: float | None) -> str:
    return f"{_percent(bound)} / {_percent(reached)}"


def _percent(relative: float | None) -> str:
    if relative is None:
        return "-"
    if not np.isfinite(relative):
        return "none"
    return "< 1e-5" if relative < 1e-7 else number(100.0 * relative, 2)
