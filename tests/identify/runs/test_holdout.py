"""Which samples fit and which judge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.pipeline import identify
from identify.runs.holdout import split
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording, Use
from tests.identify.simulated import TRUTH, sine_run


def traces(*uses: Use, duration_s: float = 4.0) -> list[Trace]:
    return [prepare(replace(sine_run(100, 3, duration_s=duration_s), use=u), i) for i, u in enumerate(uses)]


def test_runs_declared_as_held_out_judge_and_never_fit() -> None:
    found = split(traces("fit", "fit", "holdout"))
    assert [m.any() for m in found.fit] == [True, True, False]
    assert [m.any() for m in found.judge] == [False, False, True]
    assert not found.final[2].any(), "the final parameters do not see a run declared as held out"
    assert "3 Hz" in found.note


def test_where_no_run_says_blocks_three_six_and_nine_of_ten_judge_and_the_final_fit_takes_all() -> None:
    (trace,) = traces("auto")
    found = split([trace])
    share = np.array([found.judge[0][i : i + 400].mean() for i in range(0, 4000, 400)])
    np.testing.assert_allclose(share, [0, 0, 1, 0, 0, 1, 0, 0, 1, 0], atol=0.01)
    assert not (found.fit[0] & found.judge[0]).any()
    np.testing.assert_array_equal(found.final[0], trace.keep)
    np.testing.assert_array_equal(found.everything[0], trace.keep)


def test_a_run_declared_for_the_fit_fits_whole_where_others_may_be_split() -> None:
    found = split(traces("fit", "auto"))
    assert not found.judge[0].any()
    assert found.judge[1].any()


def test_where_all_runs_are_declared_alike_each_is_split() -> None:
    assert all(m.any() for m in split(traces("holdout", "holdout")).judge)
    assert all(m.any() for m in split(traces("fit", "fit")).judge)


def test_samples_that_do_not_count_neither_fit_nor_judge() -> None:
    (trace,) = traces("auto")
    trace.keep[1000:1100] = False
    found = split([trace])
    assert not (found.fit[0] | found.judge[0] | found.final[0])[1000:1100].any()


@pytest.mark.parametrize("share", [0.05, 0.1, 0.25, 0.5])
def test_the_share_that_somebody_asks_for_judges_and_never_a_runs_start(share: float) -> None:
    (trace,) = traces("auto")
    found = split([trace], share)
    assert found.judge[0].mean() == pytest.approx(share, abs=0.01)
    assert not found.judge[0][:150].any()
    assert f"identify.holdout: {share:g}" in found.note


@pytest.mark.slow
def test_a_disturbance_is_named_where_whole_runs_are_held_out_whose_phase_no_fit_knows() -> None:
    tone = [{"sine": 0.3 * np.cos(k), "cosine": 0.3 * np.sin(k), "frequency": 3.37} for k in range(3)]
    sets = ((67.0, 6.0), (111.0, 1.0), (104.0, 3.0))
    runs = [
        sine_run(*one, effects={"periodic_disturbance": t}, duration_s=1.5, seed=k)
        for k, (one, t) in enumerate(zip(sets, tone, strict=True))
    ]
    runs[2] = replace(runs[2], use="holdout")
    settings = IdentifyConfig.model_validate({"candidates": ["periodic_disturbance"]})
    found = identify(Recording(tuple(runs)), Platform(*TRUTH), settings)
    assert found.verdict.effects == ("periodic_disturbance",)
    assert found.accepted, found.reasons
    assert {"sine_run_1", "sine_run_2"} <= set(found.final.effect_parameters["periodic_disturbance"])
    assert "sine_run_3" not in found.final.effect_parameters["periodic_disturbance"], "nothing was fitted there"
