"""What the live page shows of a journal."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from commands.live.envelope import BIN_S, SHOWN_S, Envelope
from commands.live.fit import fit_of
from commands.live.state import LiveState, PlayedSet
from rig.recording.journal import BLOCK, BLOCK_HEAD, RUN, RUN_END
from tests.identify.simulated import sine_run

COLUMNS = {
    "samples": ["time_s", "rate_rad_s", "valid"],
    "commands": ["time_s", "torque_nm", "torque_commanded_nm"],
    "ticks": ["time_s", "late_s"],
}


def block(kind: str, rows: Any) -> bytes:
    table = np.asarray(rows, dtype="<f8")
    return BLOCK_HEAD.pack(kind.encode().ljust(16, b"\0"), table.shape[1]) + table.tobytes()


def begun(bias_rad_s: float = 0.0) -> LiveState:
    state = LiveState()
    limits = {"travel_deg": 10.0, "rate_deg_s": 400.0, "torque_nm": 20.0}
    state.tell({"sets": [{"name": "3 Hz", "duration_s": 4.0}], "limits": limits})
    head = {"name": "3 Hz", "meta": {"rest_bias_rad_s": bias_rad_s}, "columns": COLUMNS}
    state.take(RUN, json.dumps(head).encode())
    return state


def shown(state: LiveState) -> dict[str, Any]:
    return dict(json.loads(json.dumps(state.snapshot(), allow_nan=False)))


def test_torque_rate_lateness_and_validity_are_those_of_the_journal() -> None:
    state = begun()
    state.take(BLOCK, block("commands", [[0.0, 5.0, 5.0], [0.001, -7.0, -7.0]]))
    state.take(BLOCK, block("samples", [[0.0, 1.0, 1.0], [0.001, 9.0, 0.0], [0.002, 1.0, 1.0], [0.003, 1.0, 1.0]]))
    state.take(BLOCK, block("ticks", [[0.0, 1e-4], [0.5, 2e-3]]))
    now = shown(state)["set"]
    assert now["peak_torque_nm"] == 7.0
    assert now["torque"] == [[BIN_S / 2, -7.0, 5.0]]
    assert now["rate"][0][1:] == pytest.approx([np.degrees(1.0)] * 2, rel=1e-4)
    assert (now["valid_percent"], now["drops"]) == (75.0, 1)
    assert (now["late_max_ms"], now["time_s"], now["duration_s"]) == (2.0, 0.5, 4.0)


def test_the_angle_is_the_rate_integrated_without_the_bias_at_rest() -> None:
    state = begun(bias_rad_s=0.5)
    time = np.arange(0.0, 1.0005, 0.001)
    state.take(BLOCK, block("samples", np.c_[time, np.full(len(time), 0.6), np.ones(len(time))]))
    last = shown(state)["set"]["angle"][-1]
    assert last[2] == pytest.approx(np.degrees(0.1), rel=1e-3)


def test_the_phase_goes_from_playing_to_rest_to_identifying_to_the_result() -> None:
    state = begun()
    assert shown(state)["phase"] == "playing"
    state.take(RUN_END, b'{"complete": true}')
    assert shown(state)["phase"] == "rest" and len(state.complete) == 1
    state.tell({"note": "fitting the declared model"})
    assert (shown(state)["phase"], shown(state)["notes"]) == ("identifying", ["fitting the declared model"])
    state.tell({"result": "Finished: accepted", "report": "runs/a/report.html"})
    assert (shown(state)["phase"], shown(state)["result"]) == ("done", "Finished: accepted")
    assert shown(state)["report"] == "runs/a/report.html"


def test_a_set_that_was_cut_short_is_not_fitted() -> None:
    state = begun()
    state.take(RUN_END, b'{"complete": false}')
    assert state.complete == []


def test_an_envelope_keeps_peaks_and_the_last_seconds_alone() -> None:
    envelope = Envelope()
    time = np.arange(0.0, 20.0, 0.001)
    values = np.where(np.isclose(time, 19.0), 7.0, np.sin(time))
    envelope.add(time, values)
    points = envelope.points()
    assert points[0][0] > 20.0 - SHOWN_S - 2 * BIN_S
    assert max(high for _, _, high in points) == 7.0
    envelope.add(np.array([21.0]), np.array([np.nan]))
    assert envelope.points() == points


def test_the_fit_of_complete_sets_is_near_the_platform() -> None:
    run = sine_run(40.0, 3.0, duration_s=3.0)
    assert run.rate_rad_s is not None and run.torque_time_s is not None and run.torque_nm is not None
    one = PlayedSet("3 Hz", {"torque_hold": "band_limited"}, COLUMNS)
    one.add("samples", np.c_[run.time_s, run.rate_rad_s, np.ones(len(run.time_s))])
    one.add("commands", np.c_[run.torque_time_s, run.torque_nm, run.torque_nm])
    found = fit_of([one], ("inertia", "damping", "stiffness"))
    assert found["sets"] == 1
    assert float(found["terms"]["stiffness"]["value"]) == pytest.approx(681.2, rel=0.02)
    assert float(found["terms"]["stiffness"]["half"]) > 0.0
    for term in found["terms"].values():
        decimals = [len(term[key].partition(".")[2]) for key in ("value", "half")]
        assert decimals[0] == decimals[1], "as many digits as the interval supports"
