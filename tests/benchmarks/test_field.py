"""The field bench: its cases hide their truth and show what was hidden, and are scored honestly."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from benchmarks.field import cases, generate, library, run
from benchmarks.field.evidence import ENERGY, MOST_ERROR_PERCENT
from benchmarks.field.files import write_case
from benchmarks.field.score import Score, score, scores
from benchmarks.field.tables import listing, rows, table

HIDDEN = cases.Order("single", ("cogging",))
RAN = {"exit_code": 0, "seconds": 2.0, "cpu_seconds": 1.5, "peak_mib": 200.0}


@pytest.fixture(scope="module")
def case() -> cases.Case:
    return cases.make(1, 13, HIDDEN)


def verdict(case: cases.Case, *named: str, off_percent: float = 0.0, **more: Any) -> dict[str, Any]:
    """A result.json that names ``named`` and is off by so much in J."""
    rig = case.rig
    values = {"inertia": rig.inertia * (1.0 + 0.01 * off_percent), "damping": rig.damping}
    values |= {"stiffness": rig.stiffness} if rig.has_spring else {}
    model = {"parameters": {n: {"value": v, "ci95": [0.99 * v, 1.01 * v]} for n, v in values.items()}}
    said = {"effects": list(named), "confusable_with": {}, "unexplained": False} | more
    return {"accepted": True, "before": model, "after": model, "verdict": said}


def judge(case: cases.Case, *named: str, off_percent: float = 0.0, **more: Any) -> Score:
    return score(case.truth(), verdict(case, *named, off_percent=off_percent, **more), RAN)


def test_a_case_shows_what_it_hides_and_determines_what_is_asked(case: cases.Case) -> None:
    assert case.evidence.energy["cogging"] > ENERGY
    assert case.times_disturbance["cogging"] >= cases.TIMES_DISTURBANCE[0]
    for name, limit in zip(case.evidence.bound, MOST_ERROR_PERCENT, strict=False):
        assert case.evidence.bound[name] < 0.01 * limit * getattr(case.rig, name)
    assert 0.8 < case.evidence.whiteness < 1.2


def test_nothing_that_the_tool_reads_tells_the_truth(case: cases.Case, tmp_path: Path) -> None:
    write_case(case, tmp_path / "cases" / "0013", tmp_path / "truth" / "0013.json")
    shown = (tmp_path / "cases" / "0013" / "rig.yaml").read_text(encoding="utf-8")
    content = yaml.safe_load(shown)
    assert set(content) == {"name", "backend", "model", "recorded"}
    assert set(content["recorded"]) <= {"runs", "torque_hold"}
    assert not [n for n in (*library.EVERYTHING, *cases.KINDS) if n in shown]
    assert content["model"]["inertia_kg_m2"] != pytest.approx(case.rig.inertia, rel=1e-3)
    assert sorted(p.suffix for p in (tmp_path / "cases" / "0013").iterdir()) == [".npz"] * len(case.measured) + [
        ".yaml"
    ]
    assert json.loads((tmp_path / "truth" / "0013.json").read_text(encoding="utf-8"))["effects"] == ["cogging"]


def test_the_same_seed_gives_the_same_case_and_another_seed_another(case: cases.Case) -> None:
    again, other = cases.make(1, 13, HIDDEN), cases.make(2, 13, HIDDEN)
    assert np.array_equal(again.measured[0].columns["torque_nm"], case.measured[0].columns["torque_nm"])
    assert other.rig.inertia != case.rig.inertia


def test_every_effect_of_the_library_is_hidden_before_one_comes_twice() -> None:
    singles = [o for _, o in cases.orders(3, 200) if o.kind == "single"]
    assert {o.effects[0] for o in singles} <= set(library.LIBRARY)
    drawn = [o.effects[0] for _, o in cases.orders(3, 300) if o.kind != "nothing"]
    assert set(drawn) >= set(library.LIBRARY)
    for _, order in cases.orders(3, 300):
        assert library.agree(order.effects)
        assert len(set(order.effects)) == len(order.effects)


def test_right_and_wrong_names(case: cases.Case) -> None:
    assert judge(case, "cogging").right
    assert judge(case, "cogging").fault == ""
    assert judge(case).fault == "nothing named"
    assert judge(case, "cogging", "backlash").wrong == ("backlash",)
    assert judge(case, "cogging", "backlash").fault == "more besides"
    assert judge(case, "unbalance").fault == "wrong names"
    assert judge(case, "cogging", "rate_bias").right
    assert score(case.truth(), None, {**RAN, "exit_code": -1}).fault == "no end"


def test_a_wrong_number_must_not_pass(case: cases.Case) -> None:
    assert judge(case, "cogging", off_percent=1.0).fault == ""
    assert judge(case, "cogging", off_percent=3.0).fault == "wrong number accepted"
    assert judge(case, "cogging", off_percent=1.0).errors_percent[0] == pytest.approx(1.0)
    assert judge(case, "cogging", off_percent=3.0).covered[0] is False


def truth_of(kind: str, *hidden: str, alike: dict[str, list[str]] | None = None, **more: Any) -> dict[str, Any]:
    evidence = {"allowed": [], "alike": alike or {}, "bound": {}, "oracle": {}, "bound_unsound": ""}
    return {
        "number": 1, "kind": kind, "effects": list(hidden), "samples": 5000,
        "rig": {"inertia": 0.0, "damping": 0.0, "stiffness": 0.0}, "evidence": evidence | more,
    }  # fmt: skip


def said(truth: dict[str, Any], *named: str, unexplained: bool = False, **beside: list[str]) -> Score:
    verdict = {"effects": list(named), "confusable_with": beside, "unexplained": unexplained}
    model = {"parameters": {}}
    return score(truth, {"accepted": not unexplained, "before": model, "after": model, "verdict": verdict}, RAN)


def test_a_name_that_the_record_does_not_part_counts_where_the_hidden_one_stands_beside_it() -> None:
    truth = truth_of("pair", "actuator_lag", "cogging", alike={"actuator_lag": ["sensor_lag"], "cogging": []})
    assert said(truth, "sensor_lag", "cogging", sensor_lag=["actuator_lag"]).right
    assert not said(truth, "sensor_lag", "cogging").right
    assert not said(truth, "creep", "cogging", creep=["actuator_lag"]).right


def test_outside_the_library_only_what_is_part_of_it_may_be_named() -> None:
    truth = truth_of("outside", "warming_friction", "creep")
    assert said(truth, unexplained=True).fault == ""
    assert said(truth, "coulomb_friction", "creep", unexplained=True).fault == ""
    assert said(truth, "cogging", unexplained=True).fault == "outside: named"
    assert said(truth, "creep").fault == "outside: not unexplained"


def test_what_a_gyro_does_by_itself_is_no_false_alarm() -> None:
    assert said(truth_of("nothing"), "sensor_lag").fault == "false alarm"
    assert said(truth_of("nothing", allowed=["sensor_lag"]), "sensor_lag").fault == ""


def test_the_chain_runs_a_command_once_a_case_and_scores_it(tmp_path: Path) -> None:
    assert not generate.generate(tmp_path, 1, 30, kinds=["nothing"], only=[20, 14])
    assert sorted(p.name for p in (tmp_path / "cases").iterdir()) == ["0014", "0020"]
    tool = tmp_path / "tool.py"
    tool.write_text(
        "import json, pathlib, sys, time\n"
        "if '0020' in sys.argv[1]: time.sleep(60)\n"
        "out = pathlib.Path(sys.argv[3]); out.mkdir()\n"
        "model = {'parameters': {}}\n"
        "said = {'effects': ['creep'], 'confusable_with': {}, 'unexplained': False}\n"
        "(out / 'result.json').write_text(json.dumps({'accepted': False, 'before': model, 'after': None, "
        "'verdict': said}))\nsys.exit(1)\n",
        encoding="utf-8",
    )
    run.run(tmp_path, [sys.executable, str(tool)], 1.0)
    first = (tmp_path / "results" / "0014.run.json").read_text(encoding="utf-8")
    run.run(tmp_path, [sys.executable, str(tool)], 1.0)
    assert (tmp_path / "results" / "0014.run.json").read_text(encoding="utf-8") == first
    found = scores(tmp_path)
    assert [s.fault for s in found] == ["false alarm", "no end"]
    assert found[0].peak_mib > 1.0
    assert {what: value for what, _, value in rows(found)}["nothing there: anything named"] == "50.0 % (1 of 2)"
    assert "| 20 | nothing |" in listing(found)
    assert table(found).startswith("Field bench, 2 cases")
