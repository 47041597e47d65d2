"""A campaign that the pre-flight refuses says where its limits and its sets stand."""

from __future__ import annotations

from pathlib import Path

import pytest

from commands.campaign.limit_locations import with_locations
from rig.config.load import load_config
from rig.errors import PreflightRefusal

RECORDED = "backend: recorded\nrecorded: {runs: [{file: a.csv}]}\n"
SIMULATED = "backend: simulated\nsimulated: {}\n"
OWN_SETS = "excitation: {sets: [{torque_nm: 1, frequency_hz: 1, duration_s: 1}]}\n"


def refused(folder: Path, text: str) -> str:
    path = folder / "rig.yaml"
    path.write_text(text, encoding="utf-8")
    refusal = PreflightRefusal("too far")
    refusal.keys = ("limits.travel_deg",)
    return str(with_locations(refusal, load_config(path)))


def test_a_limit_is_told_with_its_line_or_as_the_default(tmp_path: Path) -> None:
    assert refused(tmp_path, SIMULATED + "limits: {travel_deg: 3}\n").endswith("rig.yaml:3: limits.travel_deg is 3")
    assert "(not in the file: the default): limits.travel_deg is 10" in refused(tmp_path, SIMULATED)


@pytest.mark.parametrize(("text", "told"), [(RECORDED, True), (RECORDED + OWN_SETS, False), (SIMULATED, False)])
def test_a_configuration_of_recordings_says_where_its_sets_come_from(tmp_path: Path, text: str, told: bool) -> None:
    said = refused(tmp_path, text)
    assert ("has no excitation, so these are the sets of the default campaign" in said) is told
    assert ("its recordings are identified" in said) is told
