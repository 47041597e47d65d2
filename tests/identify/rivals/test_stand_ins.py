"""How far J, C and K hang on a named effect that may have taken up part of what is left."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identify.model.structure import Structure
from identify.residual import Dependence, Disturbance
from identify.rivals.stand_ins import moved, with_stand_ins
from identify.select.field_search import Found

LINES = Dependence("frequency", 0.01, 0.01, 1e-9)


def final(inertia: float, error: float, *effects: str) -> Any:
    return SimpleNamespace(
        values={("inertia",): inertia, ("damping",): 1.0}, names=(("inertia",), ("damping",)),
        std_error=lambda name: error, structure=Structure(effects=effects),
    )  # fmt: skip


def found(effects: tuple[str, ...], *depends: Dependence) -> tuple[Found, list[str]]:
    """A final model whose inertia is 6 % larger without any of its effects, and which of them were taken out."""
    asked: list[str] = []
    left = Disturbance(0.01, "N*m", 0.01, depends)

    def lacking(effect: str) -> Any:
        asked.append(effect)
        return final(1.06, 1e-3), None, left

    nothing = cast(Any, None)
    return Found(nothing, final(1.06, 1e-3), final(1.0, 1e-3, *effects), left, nothing, lacking), asked


def test_only_flexible_effects_are_taken_out_and_only_where_something_is_left() -> None:
    both, asked = found(("flexible_mode", "coulomb_friction"), LINES)
    left = with_stand_ins(both, lambda text: None).disturbance
    assert asked == ["flexible_mode"]
    assert left.moves_without_percent["flexible_mode"]["inertia"] == pytest.approx(6.0)
    for effects, depends in ((("flexible_mode",), ()), (("coulomb_friction",), (LINES,))):
        other, asked = found(effects, *depends)
        assert with_stand_ins(other, lambda text: None) is other
        assert asked == []


def test_a_move_within_what_the_fits_are_uncertain_by_is_none() -> None:
    assert moved(final(1.0, 0.05), final(1.06, 0.05)) == {}
    assert moved(final(1.0, 0.01), final(1.06, 0.01)) == {"inertia": pytest.approx(6.0)}
    assert moved(final(1.0, np.inf), final(1.0, np.inf)) == {}
