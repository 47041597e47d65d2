"""What the model leaves unexplained, against time, angle and rate; its spectrum is in ``spectrum``."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Literal

import numpy as np

from identify.report.page.plots.figure import (
    AFTER,
    BEFORE,
    SETS,
    Figure,
    Panel,
    Trace,
    grid,
    lines,
    noise_band,
    once_in_legend,
    points,
)
from identify.report.page.plots.motion import motion_error
from identify.report.page.plots.thinning import binned_mean, cloud, line
from identify.report.page.quantities import QUANTITIES, axis
from identify.results import Identification, RunTraces
from identify.signals.low_pass import settled
from rig.recording.run import Array

LINE_POINTS = 4000  # drawn against time, of all runs together
SMOOTH_BINS = 60  # of a run: the slow part of what is left
CLOUD_POINTS = 1500  # drawn of a cloud
FORWARD, BACKWARD = SETS[2], SETS[3]
Which = Literal["before", "after"]
NAMES = {"before": "declared model", "after": "final model"}
COLORS = {"before": BEFORE, "after": AFTER}


def residual_figures(identification: Identification) -> list[Figure]:
    """Residual against time, angle and rate, and by direction; none where nothing was simulated."""
    if not identification.traces:
        return []
    quantities = QUANTITIES[identification.axis]
    return [
        _against_time(identification),
        _against(identification, "angle_rad", quantities.angle, quantities.angle_unit),
        _by_direction(identification),
        _against(identification, "rate_rad_s", quantities.rate, quantities.rate_unit),
    ]


def models_of(identification: Identification) -> tuple[Which, ...]:
    return ("before", "after") if identification.after is not None else ("before",)


def torque_known(traces: Sequence[RunTraces]) -> bool:
    return all(t.torque_residual_before is not None and t.torque_residual_after is not None for t in traces)


def residual_of(trace: RunTraces, which: Which, torque: bool, lowpass_hz: float | None = None) -> Array:
    """Torque residual where there is one, else measured less simulated; NaN where a sample does not count."""
    if torque:
        found = trace.torque_residual_before if which == "before" else trace.torque_residual_after
        step_s = float(trace.time_s[-1] - trace.time_s[0]) / max(len(trace.time_s) - 1, 1)
        return np.where(settled(trace.keep, step_s, lowpass_hz), np.asarray(found), np.nan)
    return motion_error(trace, trace.simulated_before if which == "before" else trace.simulated_after)


def _titled(identification: Identification) -> tuple[str, bool]:
    """Title of the residual's axis, and whether it is a torque."""
    quantities, torque = QUANTITIES[identification.axis], torque_known(identification.traces)
    if torque:
        return axis(f"{quantities.torque} residual", quantities.torque_unit), True
    return axis("error", quantities.measured(identification.traces[0])[1]), False


def _lowpass_note(identification: Identification, torque: bool) -> str:
    cutoff = identification.final.error.lowpass_hz
    return f" After a zero-phase low-pass at {cutoff:g} Hz." if torque and cutoff else ""


def _against_time(identification: Identification) -> Figure:
    title, torque = _titled(identification)
    traces, models = identification.traces, models_of(identification)
    cutoff = identification.final.error.lowpass_hz
    starts = np.cumsum([0.0, *[1.02 * float(t.time_s[-1] - t.time_s[0]) for t in traces]])
    drawn: list[Trace] = []
    budget = max(200, LINE_POINTS // len(traces))
    for panel, which in enumerate(models, 1):
        for start, trace in zip(starts, traces, strict=False):
            x, y = line(start + trace.time_s - trace.time_s[0], residual_of(trace, which, torque, cutoff), budget)
            drawn.append(lines(x, y, NAMES[which], COLORS[which], panel, width=0.9, opacity=0.5 if torque else 1.0))
            if torque:
                drawn.append(_smoothed(start, trace, which, cutoff, panel))
    panels = [Panel("runs one after the other (s)", title) for which in models]
    layout = grid(panels, shared_x=True, gap=0.12)
    many = len(traces) > 8
    for start, trace in zip(starts, [] if many else traces, strict=False):
        layout["annotations"].append(_run_name(trace.name, float(start)))
    layout["shapes"] = _noise_bands(identification, torque, len(models))
    return Figure(
        label="Residual against time, before and after",
        caption="Each panel has its own scale. Green band: plus and minus twice the noise floor."
        + (f" Thick: mean over {SMOOTH_BINS} stretches of a run." if torque else "")
        + _lowpass_note(identification, torque),
        traces=once_in_legend(drawn),
        layout=layout,
        height=200 * len(models) + 60,
    )


def _smoothed(start: float, trace: RunTraces, which: Which, cutoff: float | None, panel: int) -> Trace:
    """The torque residual of one run without its fast part."""
    time, left = trace.time_s - trace.time_s[0], residual_of(trace, which, True, cutoff)
    x, y = binned_mean(time, left, SMOOTH_BINS)
    return lines(start + x, y, f"{NAMES[which]}, smoothed", COLORS[which], panel, width=2.4)


def _noise_bands(identification: Identification, torque: bool, panels: int) -> list[dict[str, object]]:
    """Twice the noise floor either way, as a shape in every panel."""
    floor = identification.noise_floor.residual_rms_torque if torque else identification.noise_floor.holdout_rate_rms
    return [] if floor is None else [noise_band(2.0 * floor, p) for p in range(1, panels + 1)]


def _run_name(name: str, x: float) -> dict[str, object]:
    place = {"xref": "x", "yref": "paper", "xanchor": "left", "yanchor": "bottom", "showarrow": False}
    return {"text": escape(name[:24]), "x": x, "y": 1.0, "font": {"size": 10}, "opacity": 0.8, **place}


def _against(
    identification: Identification, which_x: Literal["angle_rad", "rate_rad_s"], name: str, unit: str
) -> Figure:
    title, torque = _titled(identification)
    models, drawn = models_of(identification), []
    cutoff = identification.final.error.lowpass_hz
    for panel, which in enumerate(models, 1):
        x = np.concatenate([getattr(t, which_x) for t in identification.traces])
        y = np.concatenate([residual_of(t, which, torque, cutoff) for t in identification.traces])
        drawn.append(points(*cloud(x, y, CLOUD_POINTS), NAMES[which], COLORS[which], panel))
        mean = binned_mean(x, y)
        drawn.append(lines(*mean, f"mean, {NAMES[which]}", COLORS[which], panel, width=3))
    panels = [Panel(axis(name, unit), title, NAMES[which]) for which in models]
    return Figure(
        label=f"Residual against {name}, before and after",
        caption=(
            f"Residual against {name}: a sample of the points and their mean. Where the mean differs from zero, the "
            f"model lacks an effect that depends on the {name}. Green band: plus and minus twice the noise floor."
        ),
        traces=drawn,
        layout=grid(panels, columns=len(models), gap=0.1)
        | {"showlegend": False, "shapes": _noise_bands(identification, torque, len(models))},
        height=300,
    )


def _by_direction(identification: Identification) -> Figure:
    """Residual against angle, motion one way and the other apart: friction and loops open a gap between the two."""
    quantities, (title, torque) = QUANTITIES[identification.axis], _titled(identification)
    models, drawn = models_of(identification), []
    cutoff = identification.final.error.lowpass_hz
    x = np.concatenate([t.angle_rad for t in identification.traces])
    forward = np.concatenate([t.rate_rad_s for t in identification.traces]) > 0.0
    for panel, which in enumerate(models, 1):
        y = np.concatenate([residual_of(t, which, torque, cutoff) for t in identification.traces])
        for way, name, color in ((forward, "forward", FORWARD), (~forward, "backward", BACKWARD)):
            here = np.where(way, y, np.nan)
            drawn.append(points(*cloud(x, here, CLOUD_POINTS // 2), name, color, panel, showlegend=False))
            drawn.append(lines(*binned_mean(x, here), f"mean, {name}", color, panel, width=3))
    panels = [Panel(axis(quantities.angle, quantities.angle_unit), title, NAMES[which]) for which in models]
    return Figure(
        label=f"Residual against {quantities.angle} for either direction of motion, before and after",
        caption=(
            f"The same by direction of motion: positive {quantities.rate} (forward) and negative (backward). If the "
            "two means differ, the cause is friction or hysteresis; if they coincide, it is a spring, gravity or "
            "cogging."
        ),
        traces=once_in_legend(drawn),
        layout=grid(panels, columns=len(models), gap=0.1),
        height=300,
    )
