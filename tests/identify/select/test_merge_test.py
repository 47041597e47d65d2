"""Gravity off the axis that was named as an offset and a bent spring."""

from __future__ import annotations

import numpy as np
import pytest

from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.select.candidates import Candidates
from identify.select.merge_test import one_for_two
from identify.select.search_state import Search
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import TRUTH, traces_of, white

ALLOWED = ("torque_offset", "quadratic_stiffness", "cubic_stiffness", "unbalance", "coulomb_friction")
NOISE_RAD = 5e-5


def by_encoder(effects: dict[str, dict[str, float]]) -> Recording:
    runs = []
    for i, (torque_nm, hz) in enumerate(((90.0, 1.0), (42.0, 9.0))):
        time = np.arange(3001) * 1e-3
        torque = TorqueSignal(time, torque_nm * np.sin(2 * np.pi * hz * time))
        angle = simulate(Platform(*TRUTH, effects), time, torque, substeps=16).angle_rad
        runs.append(
            Run(
                f"{hz:g} Hz", time, np.ones(len(time), bool), angle_rad=angle + NOISE_RAD * white(len(time), seed=i),
                torque_time_s=time, torque_nm=torque.torque_nm, frequency_hz=hz,
            )
        )  # fmt: skip
    return Recording(tuple(runs))


@pytest.mark.parametrize(
    ("hidden", "ends"),
    [
        ({"unbalance": {"sine": 8.0, "cosine": 5.0}}, {"unbalance"}),
        ({"torque_offset": {"level": 5.0}, "quadratic_stiffness": {"factor": 9.0}},
         {"torque_offset", "quadratic_stiffness"}),
    ],
)  # fmt: skip
def test_an_offset_and_a_bent_spring_give_way_to_gravity_where_it_does_what_both_do(
    hidden: dict[str, dict[str, float]], ends: set[str]
) -> None:
    traces = traces_of(by_encoder(hidden))
    offer = Candidates(traces, split(traces), ALLOWED)
    start = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}
    two = {("torque_offset", "level"): 5.0, ("quadratic_stiffness", "factor"): 0.0}
    named = offer.fits.whole(Structure(effects=("torque_offset", "quadratic_stiffness")), {**start, **two})
    bare = offer.fits.whole(Structure(), start)
    assert named is not None
    assert bare is not None
    assert named.at_noise
    found = Search(bare.judged(), bare.judged(), 0.1, offer.fits.noise)
    said: list[str] = []
    after = one_for_two(offer, found, named, said.append)
    assert set(after.structure.effects) == ends
    assert after.at_noise
    assert len(said) == len(ends & {"unbalance"})
