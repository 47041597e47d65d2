"""What an excerpt of a long recording says is what the same samples of the whole recording say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from identify.simulate.shots import make_shots, predict
from rig import effects
from rig.channels import Channel
from rig.dynamics import Equations
from rig.platform import Platform
from rig.recording.run import Array, Excerpt, Run
from tests.identify.simulated import TRUTH, sine_run

PROBE = Channel("probe", "other", reference=0.0, factor=1.0)
FIRST, LAST = 1500, 3501  # samples of the excerpt, of four seconds at 1 kHz
ENDS = 50  # samples at either end that a low-pass of the excerpt changes
CLOCK_S = 1000.0  # of the recorder, when the run began


def excerpt_of(run: Run) -> Run:
    part = slice(FIRST, LAST)
    assert run.rate_rad_s is not None and run.torque_time_s is not None and run.torque_nm is not None
    return replace(
        run, time_s=run.time_s[part], valid=run.valid[part], rate_rad_s=run.rate_rad_s[part],
        torque_time_s=run.torque_time_s[part], torque_nm=run.torque_nm[part],
        channels={name: x[part] for name, x in run.channels.items()},
        excerpt=Excerpt(len(run.time_s), 1, run.time_s[FIRST], run.time_s[LAST - 1], run.time_s[0], False),
    )  # fmt: skip


@pytest.mark.parametrize(
    "effect",
    [
        {"stiffness_drift": {"slope": 20.0}},
        {"periodic_disturbance": {"sine": 5.0, "cosine": 0.0, "frequency": 0.3}},
        {"probe_stiffness": {"slope": 20.0}},
    ],
    ids=lambda e: next(iter(e)),
)
def test_time_goes_on_from_the_start_of_the_run(effect: dict[str, dict[str, float]]) -> None:
    effects.declare_channels([PROBE])
    plain = sine_run(60.0, 2.0, noise=0.0)
    assert plain.torque_time_s is not None
    run = replace(
        plain, time_s=plain.time_s + CLOCK_S, torque_time_s=plain.torque_time_s + CLOCK_S,
        channels={"probe": plain.time_s.copy()}, causes={"probe": PROBE},
    )  # fmt: skip
    whole, part = (prepare(r, 0, 0.001) for r in (run, excerpt_of(run)))
    assert part.since_start_s == pytest.approx(1.5, abs=1e-6)
    equations = {name: Equations(Platform(*TRUTH, e)) for name, e in (("with", effect), ("without", {}))}

    def seen(trace: Trace, name: str) -> Array:
        shots = make_shots(trace, 4, None)
        return predict(shots, equations[name], np.tile([0.05, 0.3], (len(shots.first), 1)), 0.0)

    of_whole, of_part = (
        seen(t, "with") - seen(t, "without")
        for t in (whole.piece(FIRST + ENDS, LAST - ENDS), part.piece(ENDS, LAST - FIRST - ENDS))
    )
    np.testing.assert_allclose(of_part, of_whole, atol=1e-4 * np.abs(of_whole).max())
