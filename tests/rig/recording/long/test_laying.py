"""Rows laid and decimated block by block are what they are all at once."""

from __future__ import annotations

import numpy as np
import pytest

from rig.decimation import REACH, keeps_white
from rig.recording.long.laying import Decimating, Laying, Uneven


def rows(count: int, step_s: float = 1e-3, seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    time = 5.0 + step_s * np.arange(count)
    return {"time": time, "valid": np.ones(count), "rate": np.sin(20.0 * time) + 0.1 * rng.standard_normal(count)}


def part(block: dict[str, np.ndarray], where: slice | np.ndarray) -> dict[str, np.ndarray]:
    return {name: values[where] for name, values in block.items()}


@pytest.mark.parametrize("factor", [2, 7, 40])
@pytest.mark.parametrize("size", [97, 1000, 10_000])
def test_blocks_of_any_size_give_the_convolution_of_the_whole(factor: int, size: int) -> None:
    block, weights = rows(10_000), keeps_white(factor)
    laying, decimating, parts = Laying(1e-3), Decimating(factor, {"rate": weights}), []
    for first in range(0, 10_000, size):
        parts.append(decimating.pass_on(laying.lay(part(block, slice(first, first + size))))["rate"])
    whole = np.convolve(block["rate"], weights, mode="valid")[::factor]
    assert decimating.reach == REACH * factor
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-12)


def test_missing_rows_are_bridged_and_marked_across_blocks() -> None:
    block = rows(1000)
    kept = np.ones(1000, dtype=bool)
    kept[495:505] = False
    left = part(block, kept)
    laying = Laying(1e-3)
    out = [laying.lay(part(left, slice(0, 495))), laying.lay(part(left, slice(495, None)))]
    bad, rate = (np.concatenate([one[name] for one in out]) for name in ("bad", "rate"))
    assert len(rate) == 1000
    np.testing.assert_array_equal(np.flatnonzero(bad), np.arange(495, 505))
    np.testing.assert_allclose(rate[494:506], np.linspace(block["rate"][494], block["rate"][505], 12), atol=1e-12)


def test_a_sample_that_is_not_valid_is_bridged_too() -> None:
    block = rows(100)
    block["valid"][50], block["rate"][50] = 0.0, np.nan
    out = Laying(1e-3).lay(block)
    assert out["bad"][50] == 1.0 and out["bad"].sum() == 1.0
    assert out["rate"][50] == pytest.approx(0.5 * (block["rate"][49] + block["rate"][51]))


@pytest.mark.parametrize("shift_s", [0.5e-3, 2.0])
def test_stamps_between_the_beats_and_holes_of_seconds_are_no_beat(shift_s: float) -> None:
    block = rows(100)
    block["time"][50:] += shift_s
    with pytest.raises(Uneven):
        Laying(1e-3).lay(block)
