"""The measured frequency response against the closed form of a simulated platform, and coherence without its bias."""

from __future__ import annotations

import numpy as np
import pytest

from identify.frequency.measured_response import measured_response, over_periods, over_segments
from identify.frequency.model_response import Size, linear_response
from identify.frequency.spectra import Record, Response, coherence_over_periods, coherence_over_segments
from rig.dynamics import TorqueSignal, simulate
from rig.excitation import Chirp, Multisine, Sine
from rig.platform import Platform
from rig.recording.run import Array
from tests.identify.simulated import NOISE_RAD_S, white

PLATFORM = Platform(0.02, 0.045, 677.3, {"torque_delay": {"delay": 6e-4}})
STEP_S = 1e-3
RINGS_S = 1.8
SIZE = Size(0.1, 2.0, 20.0)


def played(excitation: Multisine | Chirp | Sine, noise: float = NOISE_RAD_S, seed: int = 0) -> Record:
    """A set from rest, read by a gyro with a bias."""
    time = np.arange(round(excitation.duration_s / STEP_S) + 1) * STEP_S
    torque = np.asarray(excitation.torque(time), dtype=float)
    rate = simulate(PLATFORM, time, TorqueSignal(time, torque)).sensed_rate_rad_s
    return Record(torque, rate + 1e-3 + white(len(time), noise, seed), STEP_S)


def off(found: Response) -> Array:
    """Distance from the closed form, over it."""
    true, _ = linear_response(PLATFORM, found.frequency_hz, SIZE)
    return np.abs(found.response / true - 1.0)


def of(*records: Record) -> Response:
    found = measured_response(records, RINGS_S)
    assert found is not None
    return found


def test_a_sine_gives_the_response_at_its_own_line_and_nowhere_else() -> None:
    found = of(played(Sine(torque_nm=80.0, frequency_hz=3.0, duration_s=10.0)))
    assert found.method == "whole periods"
    assert found.frequency_hz == pytest.approx([3.0], rel=1e-5)
    assert off(found)[0] < 3e-4
    assert found.gain_db[0] == pytest.approx(-31.0, abs=0.3)
    assert found.phase_deg[0] == pytest.approx(90.0, abs=1.0)


def test_a_multisine_that_repeats_gives_exact_lines_once_the_start_has_died_out() -> None:
    tones = (0.5, 1.0, 2.5, 4.0, 7.0, 12.0, 20.0, 28.0, 33.0)
    found = of(played(Multisine(kind="multisine", torque_nm=20.0, frequencies_hz=tones, duration_s=20.0)))
    assert found.method == "whole periods"
    assert found.frequency_hz == pytest.approx(tones, rel=1e-5)
    assert np.all(off(found)[3:] < 1e-2)
    assert np.median(off(found) / found.relative_error) < 3.0


def test_a_multisine_played_once_gives_its_lines_although_nothing_repeats() -> None:
    found = of(played(Multisine(kind="multisine", torque_nm=20.0, from_hz=0.5, to_hz=40.0, duration_s=20.0)))
    assert found.method == "local polynomial"
    assert len(found.frequency_hz) == 20
    assert np.median(off(found)) < 1e-4
    assert np.all(off(found) < 5e-3)
    assert np.all(found.trusted)


def test_a_single_sweep_gives_the_whole_band_with_coherence() -> None:
    found = of(played(Chirp(kind="chirp", torque_nm=20.0, from_hz=0.5, to_hz=45.0, duration_s=20.0)))
    assert found.method == "local polynomial"
    assert found.frequency_hz[0] < 4.5  # before that the sweep is a part of its own start
    assert found.frequency_hz[-1] > 40.0
    assert np.median(off(found)) < 2e-4
    assert np.max(off(found)) < 0.1  # on the flank of the resonance, a sixth of a hertz wide
    assert np.mean(found.trusted) > 0.95


def test_a_long_torque_like_noise_is_averaged_over_segments() -> None:
    time = np.arange(60_001) * STEP_S
    torque = 400.0 * np.convolve(white(len(time), seed=3), np.hanning(25) / 25.0, "same")
    rate = simulate(PLATFORM, time, TorqueSignal(time, torque)).sensed_rate_rad_s
    found = of(Record(torque, rate + white(len(time), NOISE_RAD_S, 4), STEP_S))
    assert found.method == "segments"
    assert np.median(found.averages) > 5.0
    good = (found.frequency_hz > 1.0) & (found.frequency_hz < 20.0)
    assert np.median(off(found)[good]) < 0.01


def test_more_noise_is_told_as_a_larger_error_and_less_coherence() -> None:
    chirp = Chirp(kind="chirp", torque_nm=2.0, from_hz=0.5, to_hz=20.0, duration_s=20.0)
    quiet, loud = of(played(chirp)), of(played(chirp, noise=200.0 * NOISE_RAD_S))
    assert np.median(loud.relative_error) > 20.0 * np.median(quiet.relative_error)
    assert np.mean(loud.trusted) < 0.6 < np.mean(quiet.trusted)
    known = loud.trusted
    assert np.median(off(loud)[known] / loud.relative_error[known] / np.sqrt(2.0)) == pytest.approx(0.83, abs=0.4)


def test_repeats_of_a_set_are_averaged() -> None:
    sine = Sine(torque_nm=2.0, frequency_hz=3.0, duration_s=6.0)
    several = [played(sine, noise=0.02, seed=s) for s in range(8)]
    one, all_of_them = of(several[0]), of(*several)
    assert all_of_them.averages[0] == 8.0 * one.averages[0]
    assert all_of_them.relative_error[0] < 0.6 * one.relative_error[0]


def plain_coherence(u: np.ndarray, share: float) -> Array:
    """Of motion that follows the torque's spectra u, (trials, n), by a share of its power; shape (trials,)."""
    rng = np.random.default_rng(1)
    noise = (rng.standard_normal(u.shape) + 1j * rng.standard_normal(u.shape)) / np.sqrt(2.0)
    y = np.sqrt(share) * u + np.sqrt(1.0 - share) * noise
    cross = np.abs(np.sum(y * np.conj(u), axis=1)) ** 2
    return np.asarray(cross / (np.sum(np.abs(u) ** 2, axis=1) * np.sum(np.abs(y) ** 2, axis=1)))


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.8])
def test_coherence_of_a_torque_like_noise_is_too_high_by_what_the_textbook_says(share: float) -> None:
    n, rng = 12, np.random.default_rng(0)
    u = (rng.standard_normal((20_000, n)) + 1j * rng.standard_normal((20_000, n))) / np.sqrt(2.0)
    plain = plain_coherence(u, share)
    bias = (1.0 - share) ** 2 / n
    assert np.mean(plain) - share == pytest.approx(bias, rel=0.35)
    corrected = coherence_over_segments(plain, np.full(len(plain), float(n)))
    assert abs(np.mean(corrected) - share) < 0.02 if share else np.mean(corrected) < 0.5 * bias


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.8])
def test_coherence_over_periods_is_the_share_of_power_that_follows(share: float) -> None:
    n = 6
    plain = plain_coherence(np.ones((20_000, n)), share)
    assert np.mean(plain) > share + 0.5 * (1.0 - share) / n * (1.0 - share)
    corrected = coherence_over_periods(plain, np.full(len(plain), float(n)))
    assert abs(np.mean(corrected) - share) < 0.03 if share else np.mean(corrected) < 0.5 / n


def test_where_nothing_follows_the_torque_coherence_is_small_however_few_the_periods() -> None:
    time = np.arange(10_000) * STEP_S
    torque = np.sin(2 * np.pi * 5.0 * time)
    found = [over_periods([Record(torque, white(len(time), seed=s), STEP_S)], 0.2, 9.0) for s in range(40)]
    values = np.array([f.coherence[0] for f in found if f is not None])
    assert len(values) == 40
    assert np.mean(values) < 0.2  # five periods are left: the plain estimate would be 0.2 on average, and is clipped
    assert np.mean([bool(f.trusted[0]) for f in found if f is not None]) < 0.05


def test_one_average_tells_no_coherence() -> None:
    for corrected in (coherence_over_periods, coherence_over_segments):
        assert corrected(np.array([1.0]), np.array([1.0])) == pytest.approx([0.0])


def test_a_sweep_is_not_averaged_over_segments_that_do_not_hold_it() -> None:
    record = played(Chirp(kind="chirp", torque_nm=20.0, from_hz=0.5, to_hz=20.0, duration_s=20.0))
    assert over_segments([record], RINGS_S) is None


def test_a_held_torque_acts_half_a_hold_later_than_its_samples_say() -> None:
    time = np.arange(10_001) * STEP_S
    torque = 20.0 * np.sin(2 * np.pi * 6.0 * time)
    rate = simulate(PLATFORM, time, TorqueSignal(time, torque, "zero_order"), substeps=16).sensed_rate_rad_s
    late = off(of(Record(torque, rate, STEP_S)))[0]
    assert late == pytest.approx(2 * np.pi * 6.0 * 0.5e-3, rel=0.05)
    # What is left is real: the images of the steps fold back where the rate is sampled without a filter.
    assert off(of(Record(torque, rate, STEP_S, hold_s=STEP_S)))[0] < 0.1 * late


def test_an_encoder_is_read_as_the_rate_it_implies() -> None:
    time = np.arange(10_001) * STEP_S
    torque = 20.0 * np.sin(2 * np.pi * 6.0 * time)
    angle = simulate(PLATFORM, time, TorqueSignal(time, torque)).angle_rad
    assert off(of(Record(torque, angle, STEP_S, of_angle=True)))[0] < 1e-3


@pytest.mark.parametrize(
    "record",
    [
        Record(np.ones(1000), white(1000), STEP_S),
        Record(white(1000), np.full(1000, np.nan), STEP_S),
        Record(white(20), white(20), STEP_S),
    ],
    ids=["constant torque", "no motion known", "too short"],
)
def test_where_nothing_can_be_told_nothing_is(record: Record) -> None:
    assert measured_response([record], 0.0) is None
