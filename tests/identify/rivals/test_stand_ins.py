"""Named effects that may have taken up part of what is left: taken back, or noted how far J, C and K hang on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identify.model.structure import Structure
from identify.residual import Dependence, Disturbance
from identify.results import Candidate
from identify.rivals.stand_ins import moved, with_stand_ins
from identify.select.search_state import Found, Search

LINES = Dependence("frequency", 0.01, 0.01, 1e-9)
ANGLE = Dependence("angle", 0.02, 0.02, 1e-9)
PAST = Dependence("history", 0.03, 0.03, 1e-9)


def final(inertia: float, error: float, *effects: str) -> Any:
    structure = Structure(effects=effects)
    return SimpleNamespace(
        values={("inertia",): inertia, ("damping",): 1.0, ("cogging", "order"): 7.0},
        names=(("inertia",), ("damping",)), std_error=lambda name: error, structure=structure,
        fit=SimpleNamespace(structure=structure),
    )  # fmt: skip


def found(
    effects: tuple[str, ...],
    *depends: Dependence,
    without: float = 0.0505,
    in_place: tuple[str, ...] = (),
    friction_takes_much: bool = True,
    needed: tuple[str, ...] = (),
    inertia_without: float = 1.06,
) -> tuple[Found, list[tuple[str, ...]]]:
    """A final model whose inertia is 6 % larger without any of its effects, and which were taken out together.

    It leaves 5 % of the torque, and ``without`` any of them so much of it. Of a model ``in_place`` of one that is taken
    back, nothing of what is left depends on something. Beside that, effects take nothing but those that are ``needed``.
    """
    asked: list[tuple[str, ...]] = []

    def lacking(*several: str, others: str | None = None) -> Any:
        asked.append((*several, "and others") if others is not None else several)
        left = cast(Any, SimpleNamespace(held_relative=without))
        kept = [e for e in (*effects, *(in_place if others is not None else ())) if e not in several]
        return final(inertia_without, 1e-3, *kept), left, Disturbance(0.05, "N*m", 0.05)

    def share_of(names: Sequence[str], *gone: str, others: str | None, part: Any = None) -> float:
        name = names[0]
        if part is not None and name not in needed:
            return 0.0
        alone = name == "torque_offset" and "cogging" in gone  # it takes what the ripple had taken
        much = alone or (name == "coulomb_friction" and friction_takes_much)
        return 0.25 if much else without**2 - 0.05**2

    left = Disturbance(0.01, "N*m", 0.01, depends)
    errors = cast(Any, SimpleNamespace(held_relative=0.05))
    search = Search(final(1.06, 1e-3).fit, final(1.0, 1e-3, *effects).fit, 0.0, 0.0)
    search.candidates = [Candidate(name, 1, -100.0, None, "added") for name in effects]
    before, after = final(1.06, 1e-3), final(1.0, 1e-3, *effects)
    return Found(search, before, after, left, (errors, errors), lacking, share_of), asked


def looked_at(begun: Found, travel_deg: float = 360.0) -> Found:
    return with_stand_ins(begun, cast(Any, [SimpleNamespace(travel_deg=travel_deg)]), "rotary", lambda text: None)


def test_a_flexible_effect_beside_which_something_else_is_left_is_not_named() -> None:
    begun, asked = found(("flexible_mode", "coulomb_friction"), LINES)
    less = looked_at(begun)
    assert less.named == ["coulomb_friction"]
    assert asked == [("flexible_mode", "and others")]
    assert less.after.values["inertia",] == 1.06
    assert [d.on for d in less.disturbance.depends_on] == ["frequency"]  # not forgotten, though it is not seen any more
    assert "Not named: flexible mode." in less.search.left_open
    assert "frequency" in less.search.left_open
    assert {c.effect: c.status for c in less.search.candidates}["flexible_mode"] == "left open"
    # It may be real all the same: what is reported is no surer than that.
    assert less.disturbance.moves_without_percent == {"flexible_mode": {"inertia": pytest.approx(100.0 * 0.06 / 1.06)}}


def test_what_a_stand_in_had_taken_up_may_be_that_of_another_effect_which_is_named_in_its_place() -> None:
    begun, asked = found(("cogging", "coulomb_friction"), PAST, in_place=("torque_offset",), without=0.045)
    less = looked_at(begun)
    assert asked == [("cogging", "and others")]
    assert less.named == ["coulomb_friction", "torque_offset"]
    assert less.disturbance.depends_on == ()  # what was left beside cogging is not left beside the other
    assert less.disturbance.moves_without_percent == {"cogging": {"inertia": pytest.approx(100.0 * 0.06 / 1.06)}}


def test_another_effect_in_its_place_that_leaves_more_has_not_taken_what_was_left() -> None:
    """It is asked about that, too, though beside it nothing is seen to go with anything any more."""
    begun, asked = found(("cogging", "coulomb_friction"), PAST, in_place=("directional_damping",))
    less = looked_at(begun)
    assert less.named == ["coulomb_friction"]
    assert [d.on for d in less.disturbance.depends_on] == ["history"]
    assert asked == [("cogging", "and others"), ("cogging", "directional_damping", "and others")]


def test_more_of_its_own_kind_does_not_speak_against_a_name_but_how_far_j_hangs_on_it_is_noted() -> None:
    begun, asked = found(("cogging", "coulomb_friction"), ANGLE, LINES)
    kept = looked_at(begun)
    assert kept.named == ["cogging", "coulomb_friction"]
    assert asked == [("cogging",)]
    assert kept.disturbance.moves_without_percent["cogging"]["inertia"] == pytest.approx(6.0)


def test_a_wave_that_is_not_seen_to_repeat_is_a_curve_over_the_angle_like_any_other() -> None:
    begun, _ = found(("cogging", "coulomb_friction"), ANGLE)
    assert looked_at(begun, travel_deg=10.0).named == ["coulomb_friction"]


def test_what_was_taken_back_is_not_in_the_model_that_the_others_are_judged_beside() -> None:
    begun, asked = found(("creep", "cogging"), PAST)
    kept = looked_at(begun)
    assert kept.named == ["creep"]
    assert asked == [("cogging", "and others"), ("cogging", "creep", "and others")]
    assert set(kept.disturbance.moves_without_percent) == {"cogging", "creep"}


@pytest.mark.parametrize(("effects", "depends"), [(("flexible_mode",), ()), (("coulomb_friction",), (LINES,))])
def test_where_nothing_is_left_or_all_takes_much_more_than_is_left_nothing_changes(
    effects: tuple[str, ...], depends: tuple[Dependence, ...]
) -> None:
    begun, asked = found(effects, *depends)
    assert looked_at(begun) is begun
    assert asked == []


def test_where_nothing_is_left_an_effect_that_does_nothing_for_held_out_samples_is_looked_at_without() -> None:
    begun, asked = found(("flexible_mode", "coulomb_friction"))
    begun.search.contribution.update(flexible_mode=0.9999, coulomb_friction=0.9999)
    kept = looked_at(begun)
    assert kept.named == begun.named and asked == [("flexible_mode",), ("coulomb_friction",)]
    by = {"inertia": pytest.approx(6.0)}
    assert kept.disturbance.moves_without_percent == {"flexible_mode": by, "coulomb_friction": by}
    begun.search.contribution.update(flexible_mode=1.2, coulomb_friction=1.01)
    assert looked_at(begun) is begun


@pytest.mark.parametrize(("left", "named"), [(0.05, ["cogging"]), (0.01, ["stribeck_friction", "cogging"])])
def test_an_effect_that_does_nothing_for_held_out_samples_nor_for_j_is_not_named(left: float, named: list[str]) -> None:
    """Of an error that is mostly the sensor's noise a small part counts."""
    begun, _ = found(("stribeck_friction", "cogging"), inertia_without=1.0)
    begun = replace(begun, disturbance=Disturbance(left, "N*m", left))
    begun.search.contribution.update(stribeck_friction=1.0026, cogging=1.5)
    less = looked_at(begun)
    assert less.named == named
    if "stribeck_friction" in named:
        return
    assert {c.effect: c.status for c in less.search.candidates}["stribeck_friction"] == "added, then no longer needed"


def test_of_two_effects_of_which_either_does_it_one_stays() -> None:
    """Neither seems to do anything as long as the other is there; without the first, the second is needed."""
    begun, _ = found(("stribeck_friction", "coulomb_friction"), inertia_without=1.0)
    begun.search.contribution.update(stribeck_friction=1.0, coulomb_friction=1.0)
    lacking = begun.lacking

    def redundant(*several: str, others: str | None = None) -> Any:
        after, _, left = lacking(*several, others=others)
        return after, cast(Any, SimpleNamespace(held_relative=0.05 if len(several) == 1 else 0.3)), left

    assert looked_at(replace(begun, lacking=redundant)).named == ["coulomb_friction"]


def test_a_move_within_what_the_fits_are_uncertain_by_is_none() -> None:
    assert moved(final(1.0, 0.05), final(1.06, 0.05)) == {}
    assert moved(final(1.0, 0.01), final(1.06, 0.01)) == {"inertia": pytest.approx(6.0)}
    assert moved(final(1.0, np.inf), final(1.0, np.inf)) == {}


@pytest.mark.parametrize(("without", "named"), [(0.08, True), (0.06, False)])
def test_what_is_little_beside_what_an_effect_takes_does_not_speak_against_it(without: float, named: bool) -> None:
    lines = Dependence("frequency", 0.02, 0.02, 1e-9)  # power of 4e-4, beside 39e-4 and 11e-4 that the mode takes
    begun, _ = found(("flexible_mode", "coulomb_friction"), lines, without=without)
    assert ("flexible_mode" in looked_at(begun).named) is named


def test_a_stiff_effect_that_takes_little_more_than_what_is_left_is_not_named_either() -> None:
    begun, asked = found(("coulomb_friction",), LINES, friction_takes_much=False)
    less = looked_at(begun)
    assert less.named == [] and asked == [("coulomb_friction",)]  # nothing is put in its place: that would be the next
    assert "Not named: Coulomb friction." in less.search.left_open
    assert "almost any" not in less.search.left_open
    assert "1.0 % of the torque still depends on the frequency" in less.search.left_open


def test_a_delay_is_known_however_little_torque_it_takes() -> None:
    begun, asked = found(("torque_delay",), LINES)
    assert looked_at(begun) is begun and asked == []


def test_a_flexible_effect_goes_first_and_what_it_had_taken_up_is_given_to_the_others() -> None:
    begun, asked = found(("cogging", "torque_offset"), PAST)
    less = looked_at(begun)
    assert asked == [("cogging", "and others")]
    assert less.named == ["torque_offset"]


@pytest.mark.parametrize(
    ("name", "named"), [("coulomb_friction", True), ("cogging", True), ("flexible_mode", False), ("creep", False)]
)
def test_what_is_needed_beside_what_is_left_stands_unless_it_follows_almost_any_torque(name: str, named: bool) -> None:
    part = Dependence("rate" if name == "cogging" else "angle", 0.02, 0.02, 1e-9, (-1.0, 1.0), (0.0, 0.1))
    begun, _ = found((name,), part, without=0.06, friction_takes_much=False, needed=(name,))
    assert (name in looked_at(begun).named) is named


def test_a_constant_torque_takes_up_nothing_that_depends_on_something() -> None:
    begun, asked = found(("torque_offset",), ANGLE)
    assert looked_at(begun) is begun and asked == []


def test_a_dead_zone_may_stand_in_though_it_belongs_to_the_drive() -> None:
    begun, _ = found(("torque_deadzone",), ANGLE)
    assert looked_at(begun).named == []


def test_with_more_than_half_left_it_does_not_help_that_a_name_is_needed() -> None:
    much = Dependence("angle", 0.03, 0.03, 1e-9)
    begun, _ = found(("coulomb_friction",), much, without=0.06, friction_takes_much=False, needed=("coulomb_friction",))
    assert looked_at(begun).named == []


def test_beside_what_changes_about_its_average_no_name_is_asked_whether_it_is_needed() -> None:
    changing = Dependence("angle", 0.02, 0.02, 1e-9, changes="friction")
    begun, _ = found(
        ("coulomb_friction",), changing, without=0.06, friction_takes_much=False, needed=("coulomb_friction",)
    )
    assert looked_at(begun).named == []


def test_multiples_of_the_excitation_are_no_curve_beside_which_a_name_is_needed() -> None:
    lines = Dependence("frequency", 0.02, 0.02, 1e-9)
    begun, _ = found(("cubic_stiffness",), lines, without=0.06, needed=("cubic_stiffness",))
    assert looked_at(begun).named == []


@pytest.mark.parametrize(("name", "named"), [("unbalance", False), ("coulomb_friction", True)])
def test_in_the_place_of_one_of_its_kind_an_effect_stands_only_if_nothing_more_goes_with_the_angle(
    name: str, named: bool
) -> None:
    """The best of all effects over the angle takes nearly all of any curve over it."""
    begun, _ = found((name,), Dependence("angle", 1e-4, 1e-4, 1e-9, (-1.0, 1.0), (0.0, 0.1)))
    assert name in looked_at(begun).named
    assert (name in looked_at(replace(begun, taken_back=("cogging_2",))).named) is named
