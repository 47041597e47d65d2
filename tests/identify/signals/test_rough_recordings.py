"""Recordings as benches make them: jitter, losses, clipping, other rates, two channels, a start in motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from identify.estimate.final_fit import by_output_error
from identify.estimate.output_error import refine
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Array, Run
from tests.identify.simulated import NOISE_RAD_S, SETS, TRUTH, sine_run, white

NAMES = (("inertia",), ("damping",), ("stiffness",))
START = dict(zip(NAMES, (0.0201, 0.05, 676.0), strict=True))


def played(
    index: int, *, stamps: Callable[[Array, np.random.Generator], Array] = lambda t, rng: t, step_s: float = 1e-3,
    duration_s: float = 4.0, begin_s: float = 0.0, clip_rad_s: float = np.inf, angle_too: bool = False,
    torque_scale: float = 1.0,
) -> Run:  # fmt: skip
    """One of the paper's sets as a bench records it; sampled at the stamps, clipped where the gyro would."""
    rng = np.random.default_rng(index)
    amplitude, frequency = torque_scale * SETS[index][0], SETS[index][1]
    played_s = np.arange(round(duration_s / 1e-3) + 1) * 1e-3
    torque = TorqueSignal(played_s, amplitude * np.sin(2 * np.pi * frequency * played_s))
    time = stamps(np.arange(begin_s, duration_s, step_s), rng)
    fine = np.arange(round(duration_s / 1e-4) + 1) * 1e-4
    motion = simulate(Platform(*TRUTH), fine, torque, substeps=4)
    rate = np.interp(time, fine, motion.rate_rad_s) + NOISE_RAD_S * rng.standard_normal(len(time))
    clipped = np.abs(rate) >= clip_rad_s
    return Run(
        f"{frequency:g} Hz", time, ~clipped, rate_rad_s=np.clip(rate, -clip_rad_s, clip_rad_s),
        angle_rad=np.interp(time, fine, motion.angle_rad) + 1e-5 * white(len(time), seed=index) if angle_too else None,
        torque_time_s=played_s, torque_nm=torque.torque_nm, frequency_hz=frequency,
    )  # fmt: skip


def traces_of(**how: object) -> list[Trace]:
    return [prepare(played(i, **how), i) for i in range(len(SETS))]  # type: ignore[arg-type]


def off_by(traces: list[Trace], limit: float = 4.5) -> Array:
    """Relative errors; each within ``limit`` of its own standard error."""
    use = [t.keep for t in traces]
    found = by_output_error(traces, Structure(), START, 0.1, use, use)
    for name, true in zip(NAMES, TRUTH, strict=True):
        assert abs(found.values[name] - true) < limit * found.std_error(name), name
    return np.array([abs(found.values[n] / true - 1.0) for n, true in zip(NAMES, TRUTH, strict=True)])


def jittered(time: Array, rng: np.random.Generator) -> Array:
    return time + 1e-4 * rng.uniform(-1.0, 1.0, len(time))


def thinned(share: float) -> Callable[[Array, np.random.Generator], Array]:
    def stamps(time: Array, rng: np.random.Generator) -> Array:
        kept = rng.random(len(time)) > share
        kept[[0, -1]] = True
        return time[kept]

    return stamps


def test_rows_stamped_by_a_busy_host_have_their_torque_on_the_beat_too() -> None:
    traces = []
    for i, (torque, hertz) in enumerate(SETS):
        run = sine_run(torque, hertz, seed=i)
        late = np.random.default_rng([i, 9]).uniform(0.0, 3e-4, len(run.time_s))
        traces.append(prepare(replace(run, time_s=run.time_s + late, torque_time_s=run.time_s + late), i))
        assert traces[-1].scatter[1]
    assert np.all(off_by(traces) < (1e-4, 1e-3, 1e-4))
    use = [t.keep for t in traces]
    found = by_output_error(traces, Structure(), START, None, use, use)
    assert found.fit.sigma == pytest.approx(NOISE_RAD_S, rel=0.02)


@pytest.mark.parametrize("share", [0.01, 0.05])
def test_lost_samples_cost_accuracy_only_as_samples_do(share: float) -> None:
    assert np.all(off_by(traces_of(stamps=thinned(share))) < (1e-4, 1e-3, 1e-4))


def test_stamps_that_jitter_by_a_tenth_of_a_sample_do_no_harm() -> None:
    assert np.all(off_by(traces_of(stamps=jittered)) < (1e-4, 1e-3, 1e-4))


@pytest.mark.parametrize("rate_hz", [100, 250, 10_000])
def test_any_sample_rate_from_a_hundred_hertz_to_ten_kilohertz_will_do(rate_hz: int) -> None:
    traces = traces_of(step_s=1.0 / rate_hz, duration_s=2.0)
    assert traces[0].step_s == pytest.approx(1.0 / rate_hz)
    assert np.all(off_by(traces) < (1e-3, 1e-2, 1e-3))


def test_samples_that_the_gyro_clipped_are_flagged_and_carry_no_weight() -> None:
    traces = traces_of(clip_rad_s=4.0)
    lost = [1.0 - float(np.mean(t.keep)) for t in traces]
    assert max(lost) > 0.05  # or nothing was clipped
    assert np.all(off_by(traces) < (1e-4, 1e-3, 1e-4))


def test_a_recording_may_start_while_the_platform_moves() -> None:
    traces = traces_of(begin_s=0.73)
    assert abs(traces[0].measured[0]) > 10 * NOISE_RAD_S
    assert np.all(off_by(traces) < (1e-4, 3e-3, 1e-4))


def test_angle_and_rate_together_are_one_recording_without_a_bias_to_fit() -> None:
    traces = traces_of(angle_too=True)
    assert not any(t.biased for t in traces)
    assert np.all(off_by(traces, limit=6.0) < (1e-4, 1e-3, 1e-4))


def test_repeats_at_another_amplitude_add_up() -> None:
    once = traces_of()
    again = [prepare(played(i, torque_scale=0.4), 5 + i) for i in range(5)]
    alone = refine(once, Structure(), START)
    both = refine([*once, *again], Structure(), START)
    gained = np.diag(both.information) / np.diag(alone.information)
    np.testing.assert_allclose(gained, 1.0 + 0.4**2, rtol=0.02)
    assert both.sigma == pytest.approx(NOISE_RAD_S, rel=0.03)


def test_a_stuck_minute_of_zeros_flagged_invalid_is_as_if_it_were_not_there() -> None:
    run = played(3)
    broken = run.rate_rad_s is not None and run.rate_rad_s.copy()
    assert isinstance(broken, np.ndarray)
    broken[1000:1400] = 0.0
    valid = run.valid.copy()
    valid[1000:1400] = False
    one = refine([prepare(replace(run, rate_rad_s=broken, valid=valid), 0, NOISE_RAD_S)], Structure(), START)
    np.testing.assert_allclose(one.vector, TRUTH, rtol=2e-3)
