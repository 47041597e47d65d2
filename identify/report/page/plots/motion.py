"""Measured and simulated motion of every run, and what is left between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.report.page.plots.figure import (
    AFTER,
    BEFORE,
    FLOOR,
    MEASURED,
    Figure,
    Panel,
    band,
    grid,
    level,
    lines,
    once_in_legend,
)
from identify.report.page.plots.thinning import line
from identify.report.page.quantities import QUANTITIES, axis
from identify.results import Identification, RunTraces
from rig.recording.run import Array

DRAWN_POINTS = 3000  # of one line
MAX_RUNS_DRAWN = 12  # drawn at most; result.json and recording.h5 have all


def motion_error(trace: RunTraces, simulated: Array) -> Array:
    """Measured less simulated, NaN where a sample does not count, (n,)."""
    return np.where(trace.keep > 0.0, trace.measured - simulated, np.nan)


def by_decreasing_error(traces: Sequence[RunTraces]) -> list[int]:
    """Numbers of the runs, the one with the largest error of the final model first."""
    errors = [float(np.nan_to_num(_rms(motion_error(t, t.simulated_after)))) for t in traces]
    return sorted(range(len(traces)), key=lambda i: -errors[i])


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def motion_figures(identification: Identification) -> list[Figure]:
    """One figure a run, in the order played; of very many runs those with the largest error."""
    drawn = sorted(by_decreasing_error(identification.traces)[:MAX_RUNS_DRAWN])
    return [run_figure(identification, identification.traces[i]) for i in drawn]


def run_figure(identification: Identification, trace: RunTraces) -> Figure:
    """Measured and simulated motion of one run, and the error before and after."""
    name, unit = QUANTITIES[identification.axis].measured(trace)
    time, two = trace.time_s - trace.time_s[0], identification.after is not None
    drawn = [
        lines(*line(time, trace.measured, DRAWN_POINTS), "measured", MEASURED, width=3.5, opacity=0.6),
        lines(
            *line(time, trace.simulated_before, DRAWN_POINTS),
            "declared model",
            BEFORE,
            visible="legendonly" if two else True,
        ),
    ]
    panels = [Panel("", axis(name, unit)), Panel("", axis("error", unit), "measured minus the declared model")]
    before = motion_error(trace, trace.simulated_before)
    drawn.append(
        lines(*line(time, before, DRAWN_POINTS), "error, declared model", BEFORE, 2, width=0.9, showlegend=False)
    )
    if two:
        after = motion_error(trace, trace.simulated_after)
        drawn.append(lines(*line(time, trace.simulated_after, DRAWN_POINTS), "final model", AFTER, width=1.0))
        drawn.append(
            lines(*line(time, after, DRAWN_POINTS), "error, final model", AFTER, 3, width=0.9, showlegend=False)
        )
        panels.append(Panel("", axis("error", unit), "measured minus the final model"))
    last = len(panels)
    panels[-1] = Panel("time since the start of the run (s)", panels[-1].y_title, panels[-1].title)
    layout = grid(panels, shared_x=True, gap=0.1)
    floor = identification.noise_floor.holdout_rate_rms
    layout["shapes"] = [level(sign * 2.0 * floor, FLOOR, last) for sign in (-1, 1)]
    shaded = stretches(time, trace.holdout)
    layout["shapes"] += [band(a, b, p) for a, b in shaded for p in range(1, last + 1)]
    return Figure(
        label=f"Run {trace.name}: measured and simulated {name} against time, and the error before and after",
        heading=trace.name,
        caption=f"Dashed green: twice the noise of the sensor.{' Shaded: held out.' if shaded else ''}",
        traces=once_in_legend(drawn),
        layout=layout,
        height=230 * last - 60,
        zooms=(("whole run", None), ("start, 1 s", (0.0, min(1.0, float(time[-1]))))),
    )


def stretches(time: Array, flag: Array, most: int = 40) -> list[tuple[float, float]]:
    """Begin and end of each stretch in which ``flag`` is set; none where all or very many are."""
    on = np.concatenate([[0], (flag > 0.0).astype(int), [0]])
    begin, end = np.flatnonzero(np.diff(on) > 0), np.flatnonzero(np.diff(on) < 0) - 1
    if len(begin) > most:
        return []
    return [(float(time[a]), float(time[b])) for a, b in zip(begin, end, strict=True)]
