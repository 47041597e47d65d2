"""A model in torque stands against the likelihood's where it follows nothing freely and the other leaves a multiple."""

from __future__ import annotations

import numpy as np
import pytest

from identify.diagnose.torque_fit import TorqueFit
from identify.model.structure import Structure
from identify.select.preference import follows_nothing_freely

NOTHING = np.zeros(0)


def fit(*effects: str) -> TorqueFit:
    structure = Structure(effects=effects)
    return TorqueFit(structure, (), NOTHING, 100, 1.0, 0.0, np.zeros((0, 0)), 1.0, [NOTHING], [NOTHING], NOTHING)


@pytest.mark.parametrize(
    ("best", "trial", "stiff"),
    [
        (("coulomb_friction", "torque_offset"), ("coulomb_friction", "cogging"), True),
        (("coulomb_friction", "cogging"), ("cogging",), True),  # what both have follows for neither
        (("coulomb_friction", "cogging", "cogging_2"), ("cogging", "hysteresis"), True),  # nor does one wave more
        (("coulomb_friction", "cogging"), (), False),
        (("coulomb_friction", "actuator_lag"), ("coulomb_friction",), False),
        (("torque_delay",), (), False),
    ],
)
def test_friction_and_a_constant_torque_follow_nothing_freely(
    best: tuple[str, ...], trial: tuple[str, ...], stiff: bool
) -> None:
    assert follows_nothing_freely(fit(*best), fit(*trial)) is stiff
