"""Three effects of which one can follow anything need a residual that is nothing but noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.estimate.final_fit import FinalFit, by_output_error
from identify.model.structure import Structure
from identify.rivals.whiteness_test import COLOURED_SIGMAS, coloured, fails_whiteness_test, leaves_a_disturbance
from rig.platform import TERMS
from rig.recording.run import Array, Recording
from tests.identify.simulated import NOISE_RAD_S, TRUTH, campaign, traces_of

LINE = 0.3 * NOISE_RAD_S * np.sin(2.0 * np.pi * 17.3e-3 * np.arange(2001))


def fitted(left: Array | None = None) -> FinalFit:
    """J, C and K fitted to a clean campaign whose gyro also shows ``left``."""
    recording = campaign(duration_s=2.0)
    if left is not None:
        runs = (replace(r, rate_rad_s=r.rate_rad_s + left) for r in recording.runs if r.rate_rad_s is not None)
        recording = Recording(tuple(runs))
    traces = traces_of(recording)
    use = [t.keep for t in traces]
    start = {(name,): value for name, value in zip(TERMS, TRUTH, strict=True)}
    return by_output_error(traces, Structure(TERMS), start, 0.2, use, use)  # type: ignore[arg-type]


def named(fit: FinalFit, *names: str) -> FinalFit:
    return replace(fit, fit=replace(fit.fit, structure=Structure(TERMS, names)))


def test_white_noise_is_not_coloured_and_a_twentieth_of_its_power_low_down_is() -> None:
    assert abs(coloured(fitted())) < COLOURED_SIGMAS
    assert coloured(fitted(LINE)) > COLOURED_SIGMAS


@pytest.mark.parametrize(
    ("names", "declared", "too_much"),
    [
        (("unbalance", "backlash", "cogging"), (), True),
        (("unbalance", "backlash", "cogging"), ("backlash",), False),
        (("unbalance", "coulomb_friction", "quadratic_damping"), (), False),
        (("unbalance", "cogging"), (), False),
    ],
)
def test_only_three_of_which_one_follows_anything_are_asked(
    names: tuple[str, ...], declared: tuple[str, ...], too_much: bool
) -> None:
    assert fails_whiteness_test(named(fitted(LINE), *names), declared) == too_much
    assert not fails_whiteness_test(named(fitted(), *names), declared)


@pytest.mark.parametrize(("times_noise", "disturbed"), [(0.0, False), (0.3, False), (0.9, True)])
def test_what_a_free_run_leaves_beyond_the_noise_is_a_disturbance(times_noise: float, disturbed: bool) -> None:
    fit = fitted(times_noise / 0.3 * LINE)
    assert leaves_a_disturbance(fit, traces_of(campaign(duration_s=2.0))) is disturbed
