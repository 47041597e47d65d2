"""A run made ready: noise, bandwidth, lost samples, jitter, stretches, torques along the motion."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from identify.signals.noise import NOISE_SCATTER, bandwidth_of, least_of, noise_of
from identify.signals.prepare import Channels, one_noise, prepare
from identify.signals.trace import UPSAMPLING
from rig import effects
from rig.recording.run import Array, Run
from tests.identify.simulated import NOISE_RAD_S, sine_run, white
from tests.rig.effects.values import VALUES

TIME = np.arange(8001) * 1e-3


def gyro(rate: Array, time: Array = TIME, **more: object) -> Run:
    return replace(Run("run", time, np.ones(len(time), bool), rate_rad_s=rate), **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [0.0, 1.0, 100.0, 1e4])
def test_the_noise_is_found_under_sines_ten_thousand_times_larger(size: float) -> None:
    lines = size * (np.sin(2 * np.pi * 0.5 * TIME) + np.sin(2 * np.pi * 29.3 * TIME) + np.sin(2 * np.pi * 120 * TIME))
    assert noise_of(lines + white(len(TIME))) == pytest.approx(1.0, rel=0.05)


def test_the_noise_estimate_neither_runs_high_nor_low() -> None:
    found = [noise_of(white(4000, 0.3, seed)) for seed in range(60)]
    assert np.mean(found) == pytest.approx(0.3, rel=0.01)


def test_the_noise_of_a_short_record_is_found_too() -> None:
    assert np.mean([noise_of(white(50, 2.0, seed)) for seed in range(50)]) == pytest.approx(2.0, rel=0.1)


def test_the_bandwidth_reaches_above_the_highest_line_and_not_to_the_noise() -> None:
    rate = np.sin(2 * np.pi * 3 * TIME) + 0.3 * np.sin(2 * np.pi * 40 * TIME) + white(len(TIME), 1e-3)
    assert 40 < bandwidth_of(rate, 1e-3) < 100


def test_jittered_samples_are_laid_on_a_uniform_grid_without_an_error_that_shows() -> None:
    time = TIME + np.random.default_rng(2).uniform(-2e-4, 2e-4, len(TIME))
    time[0] = 0.0
    trace = prepare(gyro(5.0 * np.sin(2 * np.pi * 29 * time), time))
    grid = trace.start_s + trace.step_s * np.arange(len(trace.measured))
    inside = slice(20, -20)
    assert np.max(np.abs(trace.measured - 5.0 * np.sin(2 * np.pi * 29 * grid))[inside]) < NOISE_RAD_S


def test_lost_samples_are_bridged_and_carry_no_weight() -> None:
    rate = np.sin(2 * np.pi * 5 * TIME)
    valid = np.ones(len(TIME), bool)
    valid[[100, 2000, 2001, 2002]] = False
    trace = prepare(gyro(np.where(valid, rate, np.nan), valid=valid))
    assert not trace.keep[[100, 2000, 2001, 2002]].any()
    assert trace.count == len(TIME) - 4
    assert trace.stretches == [(0, len(TIME) - 1)]
    np.testing.assert_allclose(trace.measured, rate, atol=1e-5)


def test_missing_rows_count_as_lost_samples() -> None:
    kept = np.delete(np.arange(len(TIME)), [500, 501, 3000])
    trace = prepare(gyro(np.sin(TIME[kept]), TIME[kept]))
    assert len(trace.measured) == len(TIME)
    assert not trace.keep[[500, 501, 3000]].any()


def test_a_long_gap_cuts_the_run_in_two_stretches() -> None:
    kept = np.delete(np.arange(len(TIME)), np.arange(3000, 3500))
    trace = prepare(gyro(np.sin(TIME[kept]), TIME[kept]))
    assert trace.stretches == [(0, 2999), (3500, 8000)]
    assert not trace.keep[3000:3500].any()


def test_an_encoder_tells_what_turned_in_a_gap_and_how_far_the_gyro_has_drifted() -> None:
    w = 2.0 * np.pi * 10.0
    kept = np.delete(np.arange(len(TIME)), np.arange(3020, 3120))
    t = TIME[kept]
    drift = 0.02 * np.sin(np.pi * t / t[-1])  # of the integral: a bias that wanders
    rate = 5.0 * w * np.cos(w * t) + np.gradient(drift, t)
    encoder = 2e-3 * np.round((5.0 * np.sin(w * t)) / 2e-3)
    run = gyro(rate, t, angle_rad=encoder)
    trace = prepare(run, channels=Channels("rate"))
    angle = trace.fine[0][::UPSAMPLING]
    for first, last in trace.stretches:
        at = np.arange(first + 20, last - 20)
        assert np.max(np.abs(angle[at] - 5.0 * np.sin(w * TIME[at]))) < 0.01  # of 5 rad


def test_samples_whose_filter_reaches_across_a_seam_do_not_count() -> None:
    torque = {"torque_time_s": TIME, "torque_nm": np.sin(20.0 * TIME)}
    filtered = gyro(np.sin(20.0 * TIME), rate_corner_hz=262.0, rate_delay_s=2.2e-3, **torque)
    plain = prepare(gyro(np.sin(20.0 * TIME), **torque))
    trace = prepare(filtered)
    begin, end = trace.stretches[0]
    assert (begin, end) == plain.stretches[0]
    assert not np.any(trace.keep[: begin + 3])
    assert not np.any(trace.keep[end - 2 :])
    np.testing.assert_array_equal(trace.keep[begin + 3 : end - 2], plain.keep[begin + 3 : end - 2])


def test_samples_slower_than_asked_for_are_left_out() -> None:
    trace = prepare(gyro(np.sin(2 * np.pi * 0.5 * TIME), min_rate_rad_s=0.5))
    fast = np.abs(np.sin(2 * np.pi * 0.5 * TIME)) > 0.5
    assert np.mean(trace.keep == fast) > 0.999
    assert len(trace.stretches) == 8


@pytest.mark.parametrize(("rate_noise", "angle_noise", "channel"), [(1e-3, 1e-3, "rate"), (0.5, 1e-6, "angle")])
def test_of_two_channels_the_one_that_tells_more_is_predicted(
    rate_noise: float, angle_noise: float, channel: str
) -> None:
    w = 2 * np.pi * 3
    rate = w * np.cos(w * TIME) + white(len(TIME), rate_noise, 1)
    trace = prepare(gyro(rate, angle_rad=np.sin(w * TIME) + white(len(TIME), angle_noise, 2)))
    assert trace.channel == channel
    assert not trace.biased, "an encoder beside the gyro shows its bias"


def test_a_gyro_alone_may_be_biased_and_an_encoder_is_absolute() -> None:
    assert prepare(gyro(np.sin(TIME))).biased
    encoder = Run("run", TIME, np.ones(len(TIME), bool), angle_rad=np.sin(TIME))
    assert not prepare(encoder).biased


def test_a_piece_holds_the_samples_and_the_motion_of_the_whole() -> None:
    trace = prepare(sine_run(100, 3))
    piece = trace.piece(1000, 1500)
    np.testing.assert_array_equal(piece.measured, trace.measured[1000:1501])
    for part, whole in zip(piece.fine[:4], trace.fine[:4], strict=True):
        np.testing.assert_array_equal(part, whole[1000 * UPSAMPLING : 1500 * UPSAMPLING + 1])
    assert piece.start_s == pytest.approx(1.0)
    assert piece.stretches == [(0, 500)]


def test_torque_pieces_are_the_torque_between_the_samples() -> None:
    trace = prepare(sine_run(100, 9))
    plain = trace.torque_pieces(())
    assert plain is not None
    pieces, upsampling = plain
    assert upsampling == 1
    middle = pieces @ (5e-4 ** np.arange(4))
    np.testing.assert_allclose(middle, 100 * np.sin(2 * np.pi * 9 * (TIME[:4000] + 5e-4)), atol=2e-4)


def test_a_delayed_torque_is_the_torque_of_earlier() -> None:
    trace = prepare(sine_run(100, 9))
    late = trace.torque_pieces((("torque_delay", (2.3e-3,)),))
    assert late is not None
    pieces, upsampling = late
    at = 1e-3 / upsampling * np.arange(len(pieces))
    np.testing.assert_allclose(pieces[50:, 0], 100 * np.sin(2 * np.pi * 9 * (at[50:] - 2.3e-3)), atol=1e-4)


def test_a_held_torque_keeps_its_steps() -> None:
    trace = prepare(replace(sine_run(100, 9), torque_hold="zero_order"))
    held = trace.torque_pieces(())
    assert held is not None
    np.testing.assert_allclose(
        held[0][:, 0].reshape(-1, UPSAMPLING), np.tile(100 * np.sin(2 * np.pi * 9 * TIME[:4000, None]), 4), atol=1e-9
    )


def test_friction_along_the_measured_motion_opposes_it_and_fades_within_the_noise() -> None:
    trace = prepare(sine_run(100, 1))
    pieces = trace.effect_pieces(effects.get("coulomb_friction"), (), 0)
    assert pieces is not None
    _, rate, _, _, left = trace.fine
    clear = np.abs(rate[:-1]) > 3 * left
    np.testing.assert_array_equal(pieces[clear, 0], np.sign(rate[:-1][clear]))
    assert np.all(np.abs(pieces[:, 0]) <= 1.0)


@pytest.mark.parametrize("name", ["creep", "presliding_friction", "hysteresis", "flexible_mode"])
def test_memory_along_the_measured_motion_follows_its_equation(name: str) -> None:
    trace = prepare(sine_run(100, 1, noise=1e-9))
    effect, given = effects.get(name), VALUES[name]
    shape = tuple(given[p.name] for p in effect.parameters if not p.linear)
    pieces = trace.effect_pieces(effect, shape, 0)
    assert pieces is not None
    angle, rate, _, _, _ = trace.fine
    found = np.append(pieces[:, 0], 0.0)[2000:-1]
    reference = memory(name, given, angle, rate, trace.step_s / UPSAMPLING)[2000 : len(angle) - 1]
    assert np.sqrt(np.mean((found - reference) ** 2)) < 0.01 * np.sqrt(np.mean(reference**2))


def memory(name: str, given: dict[str, float], angle: Array, rate: Array, step_s: float) -> Array:
    """The torque at gain one, its states by forty Euler steps a fine step, shape as the angle."""
    many = 40
    at = np.arange(len(angle) - 1)[:, None] + np.arange(many) / many
    th, w = np.interp(at.ravel(), np.arange(len(angle)), angle), np.interp(at.ravel(), np.arange(len(rate)), rate)
    h, z, q, out = step_s / many, 0.0, 0.0, np.zeros(len(th))
    z = th[0] if name in ("creep", "flexible_mode") else 0.0
    for i in range(len(th)):
        if name == "creep":
            out[i] = th[i] - z
            z += h * (th[i] - z) / given["time"]
        elif name == "presliding_friction":
            out[i] = z
            z += h * (w[i] - abs(w[i]) * z) / given["displacement"]
        elif name == "hysteresis":
            out[i] = z
            knee = abs(z) ** given["exponent"] * (given["share"] * math.copysign(1, w[i] * z) + 1 - given["share"])
            z += h * w[i] / given["yield_angle"] * (1 - knee)
        else:
            own = 2 * math.pi * given["frequency"]
            out[i] = own**2 * (th[i] - z) + 2 * given["ratio"] * own * (w[i] - q)
            q += h * out[i]
            z += h * q
    return np.append(out[::many], out[-1])


def test_the_noise_of_several_runs_is_neither_the_least_nor_the_largest_that_chance_shows() -> None:
    rng = np.random.default_rng(5)
    found = []
    for _ in range(20):
        runs = [sine_run(42, 3, duration_s=2.0) for _ in range(5)]
        noisy = [
            replace(
                run, rate_rad_s=0.3 * np.sin(19.0 * run.time_s) + NOISE_RAD_S * rng.standard_normal(len(run.time_s))
            )
            for run in runs
        ]
        one = one_noise([prepare(run, i) for i, run in enumerate(noisy)], known=False)
        assert len({t.noise for t in one}) == 1
        found.append(one[0].noise / NOISE_RAD_S)
    assert np.mean(found) == pytest.approx(1.0, abs=0.015)
    assert np.std(found) < 0.035


def test_the_noise_of_several_runs_is_known_to_a_percent_and_a_run_that_moves_too_fast_does_not_count() -> None:
    rng = np.random.default_rng(3)
    each = 1.0 + NOISE_SCATTER / math.sqrt(10_000) * rng.standard_normal((400, 5))
    pooled = np.array([least_of([(x, 10_000) for x in five]) for five in each])
    assert np.mean(pooled) == pytest.approx(1.0, abs=0.002)
    assert np.std(pooled) < 0.01
    each[:, 3:] *= 1.2
    pooled = np.array([least_of([(x, 10_000) for x in five]) for five in each])
    assert np.mean(pooled) == pytest.approx(1.0, abs=0.003)
    assert np.std(pooled) < 0.012
    assert least_of([]) == 0.0


@pytest.mark.parametrize(("bias_rad_s", "near"), [(0.0, 0.005), (0.02, 0.12)])
def test_the_travel_is_what_the_platform_does_and_not_what_the_bias_of_a_gyro_adds(
    bias_rad_s: float, near: float
) -> None:
    rate = 0.3 * 2 * np.pi * np.cos(2 * np.pi * TIME)
    assert prepare(gyro(rate + bias_rad_s)).travel_deg == pytest.approx(math.degrees(0.3), rel=near)


def test_the_travel_of_an_encoder_is_counted_from_where_it_mostly_stands_and_turns_count() -> None:
    swing = Run("swing", TIME, np.ones(len(TIME), bool), angle_rad=2.0 + np.sin(2 * np.pi * TIME))
    assert prepare(swing).travel_deg == pytest.approx(math.degrees(1.0), rel=0.02)
    assert prepare(gyro(np.full(len(TIME), 60.0) + white(len(TIME), 1e-3))).travel_deg > 360.0
