"""Which runs of a recording are fitted: those that are usable, and agree on what the sensor and the drive are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from identify.runs.noisy import describe_noisy_runs, noisy_runs
from identify.runs.refusals import refuse_too_short
from identify.runs.sign_consistency import describe_reversed_runs, reversed_runs
from identify.runs.still import describe_still_runs, still_runs
from identify.signals.prepare import above_steps, one_noise
from identify.signals.trace import Trace
from rig.errors import RecordingError


class RunsUsed(NamedTuple):
    """The runs to fit, and in words which ones were left out and why."""

    traces: list[Trace]
    left_out: tuple[str, ...]


def runs_used(traces: Sequence[Trace], noise_known: bool, axis: str, say: Callable[[str], None]) -> RunsUsed:
    """The runs that can be fitted together.

    Parameters
    ----------
    noise_known
        Whether the recording declares its noise: then no run is too noisy.

    Raises
    ------
    RecordingError
        Where no run holds enough usable samples.
    """
    usable = [t for t in traces if t.stretches and t.count > 40]
    usable = usable if noise_known else above_steps(usable)
    still = still_runs(usable)
    for trace in still:
        say(f"{trace.run.name} is left out: the platform stood still")
    usable = _without(usable, still)  # first: beside a run of nothing but noise, one with friction looks noisy
    noisy = [] if noise_known else noisy_runs(usable)
    for trace, times in noisy:
        say(f"{trace.run.name} is left out: {times:.2g} times as noisy as the other runs")
    usable = one_noise(_without(usable, [t for t, _ in noisy]), noise_known)
    if not usable:
        raise RecordingError(
            "no run holds a usable stretch of 40 samples: look at valid, min_rate_rad_s, from_s and to_s"
        )
    refuse_too_short(usable)
    flipped = reversed_runs(usable)
    for trace in flipped:
        say(f"{trace.run.name} is left out: its torque has the opposite sign of the other runs'")
    described = (
        describe_reversed_runs([t.run.name for t in flipped]),
        describe_noisy_runs([(t.run.name, times) for t, times in noisy]),
        describe_still_runs(still, axis),
    )
    return RunsUsed(_without(usable, flipped), tuple(text for text in described if text))


def _without(traces: Sequence[Trace], gone: Sequence[Trace]) -> list[Trace]:
    return [t for t in traces if not any(t is each for each in gone)]
