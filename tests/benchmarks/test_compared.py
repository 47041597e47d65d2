"""The benchmarks that compare with other tools: their commands, and when a ratio counts as worse."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import compare, estimation, genetic
from benchmarks.campaigns import TRUTH
from benchmarks.kept import Result, file_of, print_and_write
from benchmarks.long_recording import blocks

ROOT = Path(__file__).parents[2]


def test_every_command_says_what_it_does() -> None:
    """All in one process, which imports what they share once."""
    names = ("genetic", "estimation", "growth", "compare")
    lines = [["python", "-m", f"benchmarks.{name}", "--help"] for name in names]
    done = subprocess.run(
        [sys.executable, "-m", "tests.system.helps"], input=json.dumps(lines), cwd=ROOT, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    for name, (code, said, _) in zip(names, json.loads(done.stdout), strict=True):
        assert code == 0
        assert f"python -m benchmarks.{name}" in said


def test_a_ratio_a_fifth_smaller_is_worse_and_a_missing_one_too() -> None:
    kept = {"a": 10.0, "b": 10.0, "c": 10.0}
    assert compare.worse(kept, {"a": 8.01, "b": 7.9}) == ["b", "c"]


def test_a_ratio_that_looks_worse_is_measured_again_and_its_best_counts() -> None:
    measured = iter([{"a": 5.0}, {"a": 9.0}, {"a": 1.0}])
    assert compare.compared({"a": 10.0}, lambda: next(measured)) == {"a": (10.0, 9.0)}
    assert len(list(measured)) == 1  # nor more often than needed


def test_kept_results_of_every_small_benchmark_stand_where_compare_looks() -> None:
    for name in compare.BENCHMARKS:
        found = json.loads(file_of(compare.KEPT, name, True).read_text(encoding="utf-8"))
        assert found["ratios"] and found["versions"] and found["machine"] and found["seeds"]


def test_a_result_is_written_with_versions_machine_and_seeds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    print_and_write(
        Result("x", {}, [3], {"times": 2.0}, [{"tool": "one", "s": 1.5}, {"tool": "two"}]), tmp_path, small=True
    )
    text = json.loads((tmp_path / "x-small.json").read_text(encoding="utf-8"))
    assert text["seeds"] == [3] and text["versions"]["numpy"] == np.__version__ and "cores" in text["machine"]
    assert "| one | 1.5 |" in capsys.readouterr().out


def test_the_equations_of_the_search_hold_the_true_parameters_nearly() -> None:
    rows, torque = genetic.equations()
    found = np.linalg.lstsq(rows, torque, rcond=None)[0]
    assert len(torque) > 48_000
    np.testing.assert_allclose(found[[0, 2]], [TRUTH["inertia"], TRUTH["stiffness"]], rtol=0.01)


def test_the_weights_of_a_straight_torque_hold_a_platform_at_rest_on_its_spring() -> None:
    transition, first, second = estimation._foh(*TRUTH.values(), 1e-3)
    rest = np.array([1.0 / TRUTH["stiffness"], 0.0])
    np.testing.assert_allclose(transition @ rest + first + second, rest, atol=1e-12)


def test_a_long_recording_is_the_same_however_it_is_cut_into_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = next(blocks(5000, 1000.0))
    monkeypatch.setattr("benchmarks.long_recording.BLOCK", 700)
    parts = [np.concatenate(columns) for columns in zip(*blocks(5000, 1000.0), strict=True)]
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
