"""What was added early in a search in torque is judged again, and what was looked for has to be surer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from identify.diagnose.torque_fit import TorqueFit
from identify.model.structure import Structure
from identify.select.torque_search import TorqueCandidate, TorqueSearch

NOTHING = np.zeros(0)
SIZES = {"periodic_disturbance": 7}  # a phase in every run
WEIGHTS = {"periodic_disturbance": 0.6, "cogging": 0.5, "cogging_2": 0.58, "coulomb_friction": 0.4}


def fit(*effects: str) -> TorqueFit:
    names = tuple((e, f"number {k}") for e in effects for k in range(SIZES.get(e, 3)))
    x = np.zeros(len(names))
    return TorqueFit(Structure((), effects), names, x, np.zeros((0, 0)), 0.0, 1.0, 100, 1.0, [NOTHING], [NOTHING], x)


def seen(name: str, whole: TorqueFit) -> TorqueCandidate:
    return TorqueCandidate(name, whole, WEIGHTS[name], 100.0, 9.0, 9.0)


class SteadyTurning(TorqueSearch):
    """A tone goes first; a wave over the angle carries as much in its place once the friction is known."""

    offered_beside_friction: tuple[str, ...] = ("periodic_disturbance", "cogging_2")

    def candidates(self, now: TorqueFit) -> list[TorqueCandidate]:
        have = now.structure.effects
        new = {
            (): ("periodic_disturbance",),
            ("periodic_disturbance",): ("coulomb_friction",),
            ("coulomb_friction",): self.offered_beside_friction,
        }
        return [seen(n, fit(*have, n)) for n in new.get(have, ())]

    def candidate(self, name: str, now: TorqueFit, fit: TorqueFit) -> TorqueCandidate:
        return seen(name, fit)

    def without(self, now: TorqueFit, name: str) -> TorqueFit:
        return fit(*(e for e in now.structure.effects if e != name))

    def without_absorbing_stiffness(self, now: TorqueFit) -> TorqueFit:
        return now

    def backward_elimination(self, now: TorqueFit) -> TorqueFit:
        return now


def searched(search: type[SteadyTurning]) -> tuple[str, ...]:
    regression: Any = None
    return search(regression, fit(), 0.0, 1.0, []).run().structure.effects


def test_a_tone_gives_way_to_a_wave_over_the_angle() -> None:
    assert searched(SteadyTurning) == ("coulomb_friction", "cogging_2")


class NothingElse(SteadyTurning):
    offered_beside_friction = ("periodic_disturbance", "cogging")


def test_it_stays_where_the_wave_carries_clearly_less() -> None:
    assert searched(NothingElse) == ("periodic_disturbance", "coulomb_friction")


class FreerStill(SteadyTurning):
    offered_beside_friction = ("hysteresis",)


def test_what_has_more_parameters_takes_no_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(WEIGHTS, "hysteresis", 0.9)
    monkeypatch.setitem(SIZES, "hysteresis", 8)
    assert searched(FreerStill) == ("periodic_disturbance", "coulomb_friction")


@pytest.mark.parametrize(
    ("effect", "by_ratio", "by_size", "sure"),
    [
        ("coulomb_friction", 4.5, 1.0, True),
        ("cogging", 4.5, 4.5, True),
        ("cogging", 4.5, 3.0, False),  # the best of many orders
        ("cogging", 6.4, 3.3, True),  # which is not as sure by chance, whatever the order
    ],
)
def test_a_shape_that_was_looked_for_has_to_be_surer(effect: str, by_ratio: float, by_size: float, sure: bool) -> None:
    look = TorqueCandidate(effect, fit(effect), 0.4, 600.0, max(by_ratio, by_size), by_size)
    assert look.is_significant is sure
