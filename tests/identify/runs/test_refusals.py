"""Recordings and settings that nothing can be identified from."""

from __future__ import annotations

from dataclasses import replace

import pytest

from identify.pipeline import identify
from identify.runs.refusals import refuse_lowpass
from rig.config.identify import IdentifyConfig
from rig.errors import RecordingError
from rig.platform import Platform
from rig.recording.run import Recording
from tests.identify.simulated import TRUTH, sine_run, traces_of, white

RUN = sine_run(67.0, 6.0, duration_s=1.0)


def test_a_low_pass_above_what_the_samples_hold_is_refused_with_both_numbers() -> None:
    settings = IdentifyConfig(lowpass_hz=600.0)
    with pytest.raises(RecordingError, match=r"lowpass_hz is 600.*nothing above 500 Hz"):
        identify(Recording((RUN,)), Platform(*TRUTH), settings)
    refuse_lowpass(traces_of(Recording((RUN,))), 499.0)


def test_runs_in_which_nothing_moves_are_refused() -> None:
    still = replace(RUN, rate_rad_s=1e-3 * white(len(RUN.time_s)))
    with pytest.raises(RecordingError, match="nothing can be identified"):
        identify(Recording((still,)), Platform(*TRUTH), IdentifyConfig())


def test_a_torque_that_never_changes_is_refused() -> None:
    held = replace(RUN, torque_nm=0.0 * RUN.time_s + 3.0)
    with pytest.raises(RecordingError, match="same value in every sample of every run"):
        identify(Recording((held,)), Platform(*TRUTH), IdentifyConfig())


def test_a_moment_of_a_platform_is_refused_with_how_many_samples_it_takes() -> None:
    with pytest.raises(RecordingError, match=r"60 usable samples in all \(needed: 100\)"):
        identify(Recording((sine_run(67.0, 6.0, duration_s=0.059),)), Platform(*TRUTH), IdentifyConfig())
