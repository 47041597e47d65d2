"""Max_Error of the paper's Eq. 15: how far the sets are off known J, C and K (``identify.reference``), in percent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from identify.genetic.per_set import KEYS
from identify.results import SetResult
from rig.config.identify import ReferenceConfig


def with_max_error(
    sets: Sequence[SetResult], known: ReferenceConfig | None
) -> tuple[dict[str, float] | None, tuple[SetResult, ...]]:
    """The largest error of each parameter over all sets, and the sets with the errors of their own."""
    if known is None:
        return None, tuple(sets)
    largest: dict[str, float] = {}
    out = []
    for one in sets:
        parameters = dict(one.parameters)
        for term, key in KEYS.items():
            reference = getattr(known, key)
            if reference and term in parameters:
                error = 100.0 * abs(parameters[term].value - reference) / reference
                parameters[term] = replace(parameters[term], max_error_percent=error)
                largest[term] = max(largest.get(term, 0.0), error)
        out.append(replace(one, parameters=parameters))
    return largest, tuple(out)
