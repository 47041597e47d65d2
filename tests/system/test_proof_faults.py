"""A fault in the middle of a proof ends as in any campaign, and takes nothing from the campaign that is proved."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

if sys.platform == "win32":
    pytest.skip("emulated devices need pseudo terminals", allow_module_level=True)

from benchmarks.fault_cases import CASES
from benchmarks.proof.faults import FAULTS, identified, undisturbed


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.chdir(request.config.rootpath)
        folder = tmp_path_factory.mktemp("proved") / "campaign"
        identified(folder)
        return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_in_a_proof_ends_in_zero_torque_in_time_and_the_campaign_stays(
    name: str, campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.chdir(request.config.rootpath)
    case = next(case for case in CASES if case.name == name)
    assert undisturbed(case, 1.3, campaign, tmp_path / "run").wrong == ()


def test_twenty_faults_of_the_table_are_in_the_sample() -> None:
    assert len(set(FAULTS)) >= 20 and set(FAULTS) <= {case.name for case in CASES if not case.before}
