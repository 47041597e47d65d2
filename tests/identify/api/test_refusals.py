"""Wrong arguments end in one typed error that says which value is wrong and what to do."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identify.api.call import identify
from rig.errors import InputError, UsageError
from rig.platform import Platform
from rig.recording.run import Recording, Run

N = 200
T = np.arange(N) * 1e-3
M = np.sin(40.0 * T)
W = 0.5 * np.cos(40.0 * T)
A = 0.5 / 40.0 * np.sin(40.0 * T)
BAD = np.where(np.arange(N) == 7, np.nan, W)
RUN = Run("mine", T, np.ones(N, bool), rate_rad_s=W, torque_time_s=T, torque_nm=M)
with_rate = partial(identify, rate_rad_s=W)
good = partial(identify, T, M, rate_rad_s=W)


def stepping_back(at: int) -> Any:
    time = T.copy()
    time[at] = 0.0
    return time


REFUSED = {
    "lengths": (partial(with_rate, T, M[:-1]), "torque_nm has 199 values and time_s has 200: pass one value"),
    "rate length": (partial(identify, T, M, rate_rad_s=W[:3]), "rate_rad_s has 3 values and time_s has 200"),
    "nan": (
        partial(identify, T, M, rate_rad_s=BAD),
        "rate_rad_s is nan at index 7 (1 such samples): delete the sample",
    ),
    "nan in time": (partial(with_rate, np.where(T == 0, np.nan, T), M), "time_s is nan at index 0"),
    "infinite torque": (partial(with_rate, T, np.where(T == 0, np.inf, M)), "torque_nm is inf at index 0"),
    "two-dimensional": (
        partial(identify, T, M, rate_rad_s=np.stack([W, W])),
        "rate_rad_s has shape (2, 200), not (n,)",
    ),
    "a column": (
        partial(identify, T, M, rate_rad_s=W[:, None]),
        "rate_rad_s has shape (200, 1), not (n,): pass .ravel()",
    ),
    "back in time": (partial(with_rate, stepping_back(9), M), "time_s falls from 0.008 to 0 s at index 9"),
    "twice the same time": (partial(with_rate, np.where(T[5] == T, T[4], T), M), "time_s stays at 0.004 s at index 5"),
    "no channel": (partial(identify, T, M), "neither rate_rad_s nor angle_rad is given: pass at least one"),
    "no time": (partial(with_rate, None, M), "time_s is None: pass the time of every sample in seconds"),
    "text": (partial(with_rate, T, ["1.0"] * N), "torque_nm holds '1.0' at index 0, not a number: convert it first"),
    "a single text": (partial(with_rate, "run.csv", M), "time_s is 'run.csv', not a column of numbers"),
    "a single number": (partial(identify, T, M, rate_rad_s=3.0), "rate_rad_s is 3.0, not a column of numbers"),
    "complex": (partial(identify, T, M, rate_rad_s=W + 0j), "rate_rad_s holds complex128 values, not real numbers"),
    "masked": (
        partial(identify, T, M, rate_rad_s=np.ma.masked_array(W)),
        "rate_rad_s is a masked array: pass its .data",
    ),
    "dates": (
        partial(with_rate, np.datetime64("2024-01-01") + np.arange(N), M),
        "time_s holds dates or durations (datetime64[D]): pass seconds as numbers, e.g. (t - t[0])",
    ),
    "ragged": (partial(identify, T, M, rate_rad_s=np.array([W, W[:3]], dtype=object)), "rate_rad_s is arrays inside"),
    "empty": (partial(identify, [], [], rate_rad_s=[]), "time_s is empty: pass one array"),
    "no runs of samples": (partial(identify, np.array([]), M[:0], rate_rad_s=W[:0]), "0 valid samples, at least 40"),
    "short": (partial(identify, T[:20], M[:20], rate_rad_s=W[:20]), "20 valid samples, at least 40 are needed"),
    "list and array": (partial(with_rate, [T, T], [M, M]), "time_s is a list of 2 runs and rate_rad_s is not"),
    "array and list": (partial(identify, T, [M, M], rate_rad_s=W), "torque_nm is a list of 2 arrays and time_s is one"),
    "runs": (partial(identify, [T, T], [M, M], rate_rad_s=[W]), "rate_rad_s has 1 runs and time_s has 2"),
    "in run 2": (partial(identify, [T, T], [M, M], rate_rad_s=[W, BAD]), "run 2: rate_rad_s is nan at index 7"),
    "valid": (partial(good, valid=np.full(N, 2)), "valid is 2 at index 0: pass True for a good sample, else False"),
    "still": (partial(identify, T, M, rate_rad_s=np.ones(N)), "the rate never changes (1) though the torque does"),
    "degrees": (
        partial(identify, T, M, rate_rad_s=W, angle_rad=np.degrees(A)),
        "probably the angle is in degrees: multiply angle_rad by 0.0174533",
    ),
    "swapped": (partial(identify, T, M, rate_rad_s=A, angle_rad=W), "exchange angle_rad and rate_rad_s"),
    "still encoder": (
        partial(identify, T, M, rate_rad_s=W, angle_rad=np.zeros(N)),
        "check that the encoder was connected, or leave angle_rad out",
    ),
    "steady torque": (partial(with_rate, T, np.ones(N)), "check torque_nm, or leave torque_nm out for a free decay"),
    "days": (partial(with_rate, 45_000 + T / 86_400, M), "as Excel counts them: multiply time_s by 86400"),
    "milliseconds": (partial(with_rate, 1e3 * T, M), "the time looks like milliseconds: multiply time_s by 0.001"),
    "holdout": (partial(good, holdout=0.9), "holdout: 0.9 is not allowed: has to be 'auto' or at most 0.5"),
    "holdout's word": (partial(good, holdout="half"), "holdout: 'half' is not allowed"),
    "holdout's runs": (partial(good, holdout=["fit", "holdout"]), "holdout has 2 entries and there are 1 runs"),
    "holdout's use": (
        partial(good, holdout=["best"]),
        "holdout[0] is 'best': give 'auto', 'fit', 'holdout' for every run",
    ),
    "all held out": (partial(good, holdout=["holdout"]), "holdout holds out every run, so nothing is left to fit"),
    "axis": (partial(good, axis="round"), "axis: 'round' is not allowed: has to be 'rotary' or 'linear'"),
    "declared": (partial(good, declared=0.02), "declared is 0.02: pass a mapping as under model: in rig.yaml"),
    "declared's key": (
        partial(good, declared={"inertia": 1.0}),
        "declared.inertia: unknown key 'inertia', did you mean",
    ),
    "declared's value": (
        partial(good, declared={"inertia_kg_m2": -1.0}),
        "declared.inertia_kg_m2: -1.0 is not allowed",
    ),
    "declared's nan": (
        partial(good, declared={"inertia_kg_m2": np.nan}),
        "declared['inertia_kg_m2'] is nan: give a finite",
    ),
    "declared's array": (partial(good, declared={"inertia_kg_m2": T}), "which rig.yaml cannot hold: give a number"),
    "declared's effect": (
        partial(good, declared={"effects": {"coulomb": {}}}),
        "declared.effects.coulomb: unknown effect 'coulomb'",
    ),
    "declared's file": (
        partial(good, declared="nowhere/model.yaml"),
        "declared: names a model file: nowhere/model.yaml",
    ),
    "declared's platform": (
        partial(good, declared=Platform(-1.0)),
        "declared: this platform is not a valid model",
    ),
    "settings": (
        partial(good, settings={"candidate": []}),
        "settings.candidate: unknown key 'candidate', did you mean",
    ),
    "settings' holdout": (partial(good, settings={"holdout": 0.2}), "settings holds 'holdout': pass it as holdout="),
    "settings' type": (partial(good, settings=3), "settings is 3: pass a mapping"),
    "noise": (partial(good, noise=-1.0), "noise: -1.0 is not allowed"),
    "torque hold": (partial(good, torque_hold="linear"), "torque_hold: 'linear' is not allowed"),
    "channels": (
        partial(good, channels=["winding"]),
        "channels is ['winding']: pass {name: {'kind': ..., 'values': array}}",
    ),
    "channel's kind": (
        partial(good, channels={"winding": {"kind": "heat", "values": T}}),
        "channels.winding.kind: 'heat' is not allowed",
    ),
    "channel's values": (
        partial(good, channels={"winding": {"kind": "temperature"}}),
        "channels['winding'] has no 'values'",
    ),
    "channel's length": (
        partial(good, channels={"winding": {"kind": "temperature", "values": T[:4]}}),
        "channels['winding']['values'] has 4 values and time_s has 200",
    ),
    "torque beside a recording": (
        partial(identify, Recording((RUN,)), M),
        "torque_nm cannot be combined with a Recording",
    ),
    "axis beside a recording": (
        partial(identify, Recording((RUN,)), axis="rotary"),
        "axis cannot be combined with a Recording",
    ),
    "no run": (partial(identify, Recording(())), "the recording has no runs: pass at least one"),
    "no Run": (partial(identify, Recording((T,))), "where a Run has to be: make it with rig.Run"),  # type: ignore[arg-type]
    "a recording's nan": (partial(identify, Recording((replace(RUN, rate_rad_s=BAD),))), "mine: rate_rad_s is nan at"),
    "a recording's torque": (
        partial(identify, Recording((replace(RUN, torque_time_s=T[:9]),))),
        "mine: torque_nm has 200 values and torque_time_s",
    ),
    "a recording's channel": (
        partial(identify, Recording((RUN,)), channels={"winding": {"kind": "temperature"}}),
        "channels['winding'] is not in the recording (it has none): correct the name",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_used_is_refused_with_value_and_cure(case: str) -> None:
    call, words = REFUSED[case]
    with pytest.raises(InputError) as caught:
        call()
    assert words in str(caught.value)
    assert "recorded." not in str(caught.value)


def test_the_error_is_one_of_usage_and_a_value_error() -> None:
    assert issubclass(InputError, UsageError) and issubclass(InputError, ValueError)


def test_a_model_file_that_is_there_is_read(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    path.write_text("inertia_kg_m2: -2\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"declared\.inertia_kg_m2: -2 is not allowed"):
        good(declared=path)
