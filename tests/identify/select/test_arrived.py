"""A candidate that is likelier but not believed is followed to its minimum before it is given up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from identify.select.evidence import Evidence
from identify.select.forward_selection import _arrived


def seen(effect: str, cost: float, gain: float, inflation: float, weight: float = 0.5) -> Evidence:
    fit: Any = SimpleNamespace(cost=cost)
    return Evidence(effect, fit, gain, inflation, 10.0, weight)


def search_that_ends_at(ends: dict[float, float], asked: list[float]) -> Any:
    """``ends``: from which cost a fit goes on to which."""

    def all_further(fits: Any) -> list[Any]:
        asked.extend(f.cost for f in fits)
        return [SimpleNamespace(cost=ends.get(f.cost, f.cost)) for f in fits]

    def weigh(now: Any, fits: Any) -> dict[str, Evidence]:
        return {n: seen(n, f.cost, -f.cost, 1.0) for n, f in fits.items()}

    return SimpleNamespace(trials=SimpleNamespace(all_further=all_further), weigher=SimpleNamespace(all=weigh))


def test_what_scattered_because_it_had_not_arrived_is_believed_at_its_minimum() -> None:
    asked: list[float] = []
    tried = {"cogging": seen("cogging", -2000.0, 2000.0, 70.0), "creep": seen("creep", -3.0, 3.0, 1.0)}
    found = _arrived(search_that_ends_at({-2000.0: -2700.0}, asked), None, tried)  # type: ignore[arg-type]
    assert asked == [-2000.0]
    assert found["cogging"].support > 2000.0
    assert found["creep"] is tried["creep"]


def test_what_stands_at_its_minimum_stays_in_doubt() -> None:
    tried = {"cogging": seen("cogging", -2000.0, 2000.0, 70.0)}
    assert _arrived(search_that_ends_at({}, []), None, tried) is tried  # type: ignore[arg-type]


def test_what_is_believed_or_carries_nothing_is_not_asked() -> None:
    asked: list[float] = []
    tried = {"cogging": seen("cogging", -2000.0, 2000.0, 1.0), "creep": seen("creep", -900.0, 900.0, 80.0, 0.1)}
    assert _arrived(search_that_ends_at({}, asked), None, tried) is tried  # type: ignore[arg-type]
    assert asked == []
