"""The words under the tables of the terminal and of the report."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from identify.report.captions import noise_floor_sentence
from identify.results import NoiseFloor


@pytest.mark.parametrize(
    ("source", "info", "said"),
    [
        ("estimated", {}, "as estimated from the recording."),
        ("given", {}, "as stated (recorded.noise)."),
        ("given", {"played_on": "simulated"}, "as the simulated rig states it."),
        ("given", {"played_on": "bench"}, "as the gyro's driver states it."),
    ],
)
def test_the_noise_floor_says_where_its_size_comes_from(source: str, info: Mapping[str, str], said: str) -> None:
    floor = NoiseFloor(0.0162, 8.7e-4, source)  # type: ignore[arg-type]
    assert noise_floor_sentence(floor, info).endswith(said)
