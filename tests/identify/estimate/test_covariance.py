"""Covariance of a fit where its likelihood does not know all that disturbs."""

from __future__ import annotations

import numpy as np

from identify.estimate.covariance import score_scatter


def _wandering(rng: np.random.Generator, size: float) -> tuple[list[tuple[np.ndarray, np.ndarray]], np.ndarray]:
    """Two sines in five runs with white noise of one; the phase of what is measured wanders along a run by ``size``."""
    time = np.arange(2000) * 1e-3
    columns = np.column_stack([np.sin(2 * np.pi * 6.0 * time), np.cos(2 * np.pi * 6.0 * time)])
    residuals = []
    for _ in range(5):
        slow = np.interp(time, np.arange(0.0, 2.01, 0.1), rng.standard_normal(21))
        residuals.append(size * slow * columns[:, 1] + rng.standard_normal(len(time)))
    fitted = np.linalg.lstsq(np.tile(columns, (5, 1)), np.concatenate(residuals), rcond=None)[0]
    return [(columns, r - columns @ fitted) for r in residuals], fitted


def test_what_a_likelihood_does_not_know_of_shows_in_how_its_scores_scatter() -> None:
    rng = np.random.default_rng(5)
    plain = np.sqrt(1.0 / (0.5 * 5 * 2000))  # of either, where the noise is all there is
    errors, widened = [], []
    for _ in range(200):
        parts, fitted = _wandering(rng, 0.5)
        errors.append(fitted / plain)  # the truth is zero
        widened.append(score_scatter(parts))
    inside = np.mean(np.abs(errors) < 1.96 * np.array(widened), axis=0)
    assert np.mean(np.abs(np.array(errors)[:, 1]) < 1.96) < 0.5  # as the noise alone has it
    assert np.all(inside > 0.9)


def test_scores_of_noise_alone_widen_little_and_too_few_say_nothing() -> None:
    rng = np.random.default_rng(6)
    wider = np.array([score_scatter(_wandering(rng, 0.0)[0]) for _ in range(50)])
    assert np.all(wider >= 1.0)
    assert np.mean(wider) < 1.08
    columns = rng.standard_normal((40, 2))
    assert np.all(score_scatter([(columns, 5.0 * rng.standard_normal(40))]) == 1.0)
