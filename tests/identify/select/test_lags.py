"""Lags: one weight for what is the same in torque, and none for what only a negative damping makes possible."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from identify.model.structure import Structure
from identify.select.lags import PASSIVE_SIGMAS, SAME_DELAY, KnownDelays, exchanged, takes_damping
from identify.select.likelihood_search import LikelihoodSearch


def fit(
    effect: str | None, parameter: str = "", value: float = 0.0, damping: float | None = 0.1, beside: str = ""
) -> Any:
    values: dict[Any, float] = {("inertia",): 1.0} | ({("damping",): damping} if damping is not None else {})
    values |= {(effect, parameter): value} if effect else {}
    structure = Structure(effects=tuple(e for e in (beside, effect) if e))
    return SimpleNamespace(structure=structure, values=values, names=tuple(values), std_error=lambda name: 0.1)


def test_only_a_delay_as_long_beside_the_same_effects_lends_its_weight() -> None:
    known, none = KnownDelays(), fit(None)
    known.add("torque_delay", none, fit("torque_delay", "delay", 2e-3), 0.7)
    for late_s, expected in ((2e-3, 0.7), (2e-3 * (1.0 + 0.9 * SAME_DELAY), 0.7), (2.5e-3, 0.0)):
        assert known.weight_of("sensor_lag", none, fit("sensor_lag", "time", late_s)) == expected
    other = fit("sensor_lag", "time", 2e-3, beside="coulomb_friction")
    other.values["coulomb_friction", "level"] = 1.0
    assert known.weight_of("sensor_lag", none, other) == 0.0


def test_a_lag_that_takes_over_part_of_another_is_as_late_as_the_two_together_are_later() -> None:
    """A low-pass that stood for two of them becomes shorter where the second one is added."""
    now = fit("sensor_lag_second_order", "time", 2.80e-3)

    def beside(effect: str, parameter: str, value: float, low_pass: float) -> Any:
        both = fit(effect, parameter, value, beside="sensor_lag_second_order")
        both.values["sensor_lag_second_order", "time"] = low_pass
        return both

    known = KnownDelays()
    known.add("actuator_lag", now, beside("actuator_lag", "time", 0.65e-3, 2.77e-3), 0.7)
    assert known.weight_of("sensor_lag", now, beside("sensor_lag", "time", 1.0e-3, 2.43e-3)) == 0.7
    assert known.weight_of("sensor_lag", now, beside("sensor_lag", "time", 1.0e-3, 2.80e-3)) == 0.0


@pytest.mark.parametrize(
    ("effect", "parameter", "before", "after", "taken"),
    [
        ("torque_delay", "delay", 0.1, -0.1 * (PASSIVE_SIGMAS + 1.0), True),
        ("actuator_lag", "time", 0.1, -1.0, True),
        ("sensor_lag", "time", 0.1, -1.0, True),
        ("torque_delay", "delay", 0.1, -0.1 * (PASSIVE_SIGMAS - 1.0), False),  # zero as well
        ("torque_delay", "delay", -1.0, -1.0, False),  # it was there before
        ("torque_delay", "delay", None, None, False),
        ("coulomb_friction", "level", 0.1, -1.0, False),  # no lag
    ],
)
def test_a_lag_that_takes_the_damping_below_zero(
    effect: str, parameter: str, before: float | None, after: float | None, taken: bool
) -> None:
    assert takes_damping(effect, fit(None, damping=before), fit(effect, parameter, 1e-3, after)) is taken


NO_SPRING = Structure(terms=("inertia", "damping"), effects=("sensor_lag",))


def lagging(inertia: float, time_s: float, cost: float = 0.0, structure: Structure = NO_SPRING) -> Any:
    values = {("inertia",): inertia, ("damping",): 0.02, ("sensor_lag", "time"): time_s}
    return SimpleNamespace(structure=structure, values=values, noise=None, cost=cost)


def test_platform_and_lag_change_places_and_back() -> None:
    """(J s + C)(t s + 1) has the same coefficients with J' = C t and t' = J / C."""
    there = exchanged(lagging(4e-4, 0.4))
    assert there is not None
    inertia, late_s = there["inertia",], there["sensor_lag", "time"]
    assert inertia * late_s == pytest.approx(4e-4 * 0.4)
    assert inertia + 0.02 * late_s == pytest.approx(4e-4 + 0.02 * 0.4)
    back = exchanged(lagging(inertia, late_s))
    assert back is not None and back["inertia",] == pytest.approx(4e-4)


def test_beside_a_spring_or_a_damping_that_drives_they_do_not() -> None:
    assert exchanged(lagging(4e-4, 0.4, structure=Structure(effects=("sensor_lag",)))) is None
    assert exchanged(lagging(-4e-4, 0.4)) is None
    assert exchanged(fit("torque_delay", "delay", 0.4)) is None


@pytest.mark.parametrize(
    ("declared", "lead", "found"),
    [
        (5e-4, 0.0, 4e-4),
        (6e-3, 0.0, 8e-3),
        (5e-4, 50.0, 8e-3),
        (0.0, 0.0, 8e-3),
    ],  # as likely, nearer, likelier, unknown
)
def test_of_two_that_are_as_likely_the_one_that_was_declared_is_taken(
    declared: float, lead: float, found: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A declared inertia far from both may be a default and says nothing.

    ``lead``: of the one that the search has found (8e-3 beside 20 ms) over the other (4e-4 beside 0.4 s).
    """
    best = lagging(8e-3, 0.02)

    def fitted(structure: Structure, start: Any, noise: Any) -> Any:
        return lagging(start["inertia",], start["sensor_lag", "time"], cost=lead)

    monkeypatch.setattr(
        "identify.select.likelihood_search.support_difference", lambda one, other: one.cost - other.cost
    )
    stepwise: Any = SimpleNamespace(best=best, problem=SimpleNamespace(fit=fitted))
    nothing: Any = None
    search = LikelihoodSearch(stepwise, [], NO_SPRING, nothing, declared_inertia=declared)
    assert search._nearer(best).values["inertia",] == pytest.approx(found)
    assert stepwise.best.values["inertia",] == pytest.approx(found)
