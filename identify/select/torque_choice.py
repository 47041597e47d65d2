"""Which torque a search begins with: as it was recorded, or without the noise that the platform does not follow."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from identify.select.evidence import STRONG_SUPPORT
from identify.select.likelihood_search import LikelihoodSearch
from identify.signals.torque_noise import quieter
from identify.signals.trace import Trace


def start_search(
    traces: Sequence[Trace], begin: Callable[[Sequence[Trace]], LikelihoodSearch]
) -> tuple[LikelihoodSearch, float | None]:
    """The search on the runs whose declared model is likelier, and above which frequency their torque was filtered.

    None where it was not.
    """
    search = begin(traces)
    less = None if all(t.torque is None for t in traces) else quieter(traces)
    if less is None:
        return search, None
    filtered, cutoff_hz = less
    other = begin(filtered)
    if other.stepwise.base.cost > search.stepwise.base.cost - STRONG_SUPPORT:
        return search, None
    return other, cutoff_hz


def filtered_above(cutoff_hz: float, axis: str) -> str:
    """That the recorded torque was filtered, as the report says it."""
    torque = "force" if axis == "linear" else "torque"
    return f"the recorded {torque} is filtered: above {cutoff_hz:.3g} Hz it is noise that the platform does not follow"
