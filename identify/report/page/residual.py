"""What the model leaves unexplained, against time, angle, rate and frequency."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Literal

import numpy as np
from scipy import signal

from identify.report.page.figure import (
    AFTER,
    BEFORE,
    FLOOR,
    SETS,
    Figure,
    Panel,
    Trace,
    grid,
    level,
    lines,
    once_in_legend,
    points,
    upright,
)
from identify.report.page.motion import left_over
from identify.report.page.quantities import QUANTITIES, axis
from identify.report.page.thinning import binned_mean, cloud, line
from identify.results import Identification, RunTraces
from rig.recording.run import Array

LINE_POINTS = 4000
CLOUD_POINTS = 1500
EDGE_PERIODS = 3.0  # of the low-pass, not drawn at either end of a run: there the filter looks into nothing
SHORTEST_EDGES = 20.0  # a run has to be this many times longer
SEGMENT = 4096  # samples of one Welch segment at most
FORWARD, BACKWARD = SETS[2], SETS[3]
ODD, EVEN, FREE = SETS[7], SETS[1], SETS[6]
Which = Literal["before", "after"]
NAMES = {"before": "declared model", "after": "final model"}
COLORS = {"before": BEFORE, "after": AFTER}


def residual_figures(identification: Identification) -> list[Figure]:
    """Residual against time, angle, rate and frequency, and by direction; none where nothing was simulated."""
    if not identification.traces:
        return []
    quantities = QUANTITIES[identification.axis]
    return [
        _against_time(identification),
        _against(identification, "angle_rad", quantities.angle, quantities.angle_unit),
        _by_direction(identification),
        _against(identification, "rate_rad_s", quantities.rate, quantities.rate_unit),
        _spectrum(identification),
    ]


def _models(identification: Identification) -> tuple[Which, ...]:
    return ("before", "after") if identification.after is not None else ("before",)


def _torque_known(traces: Sequence[RunTraces]) -> bool:
    return all(t.torque_residual_before is not None and t.torque_residual_after is not None for t in traces)


def settled(trace: RunTraces, lowpass_hz: float | None) -> Array:
    """1.0 where the zero-phase low-pass stands clear of the ends of the run, (n,)."""
    inside = np.ones(len(trace.time_s))
    edge = 0.0 if not lowpass_hz else EDGE_PERIODS / lowpass_hz
    time = trace.time_s - trace.time_s[0]
    if time[-1] > SHORTEST_EDGES * edge:
        inside[(time < edge) | (time > time[-1] - edge)] = 0.0
    return inside


def _residual(trace: RunTraces, which: Which, torque: bool, lowpass_hz: float | None = None) -> Array:
    """Torque residual where there is one, else measured less simulated; NaN where a sample does not count."""
    if torque:
        found = trace.torque_residual_before if which == "before" else trace.torque_residual_after
        return np.where(trace.keep * settled(trace, lowpass_hz) > 0.0, np.asarray(found), np.nan)
    return left_over(trace, trace.simulated_before if which == "before" else trace.simulated_after)


def _titled(identification: Identification) -> tuple[str, bool]:
    """Title of the residual's axis, and whether it is a torque."""
    quantities, torque = QUANTITIES[identification.axis], _torque_known(identification.traces)
    if torque:
        return axis(f"{quantities.torque} residual", quantities.torque_unit), True
    return axis("error", quantities.measured(identification.traces[0])[1]), False


def _lowpass_note(identification: Identification, torque: bool) -> str:
    cutoff = identification.final.error.lowpass_hz
    return f" Behind a zero-phase low-pass at {cutoff:g} Hz." if torque and cutoff else ""


def _against_time(identification: Identification) -> Figure:
    title, torque = _titled(identification)
    traces, models = identification.traces, _models(identification)
    cutoff = identification.final.error.lowpass_hz
    starts = np.cumsum([0.0, *[1.02 * float(t.time_s[-1] - t.time_s[0]) for t in traces]])
    drawn: list[Trace] = []
    budget = max(200, LINE_POINTS // len(traces))
    for panel, which in enumerate(models, 1):
        for start, trace in zip(starts, traces, strict=False):
            x, y = line(start + trace.time_s - trace.time_s[0], _residual(trace, which, torque, cutoff), budget)
            drawn.append(lines(x, y, NAMES[which], COLORS[which], panel, width=0.9))
    panels = [Panel("runs one after the other (s)", title) for which in models]
    layout = grid(panels, shared_x=True, gap=0.12)
    many = len(traces) > 8
    for start, trace in zip(starts, [] if many else traces, strict=False):
        layout["annotations"].append(_run_name(trace.name, float(start)))
    floor = identification.noise_floor.residual_rms_torque if torque else identification.noise_floor.holdout_rate_rms
    if floor is not None:
        layout["shapes"] = [level(sign * 2.0 * floor, FLOOR, p) for sign in (-1, 1) for p in range(1, len(models) + 1)]
    return Figure(
        label="Residual against time, before and after",
        caption="Each panel has its own scale. Dashed green: twice the noise floor."
        + _lowpass_note(identification, torque),
        traces=once_in_legend(drawn),
        layout=layout,
        height=200 * len(models) + 60,
    )


def _run_name(name: str, x: float) -> dict[str, object]:
    place = {"xref": "x", "yref": "paper", "xanchor": "left", "yanchor": "bottom", "showarrow": False}
    return {"text": escape(name[:24]), "x": x, "y": 1.0, "font": {"size": 10}, "opacity": 0.8, **place}


def _against(
    identification: Identification, which_x: Literal["angle_rad", "rate_rad_s"], name: str, unit: str
) -> Figure:
    title, torque = _titled(identification)
    models, drawn = _models(identification), []
    cutoff = identification.final.error.lowpass_hz
    for panel, which in enumerate(models, 1):
        x = np.concatenate([getattr(t, which_x) for t in identification.traces])
        y = np.concatenate([_residual(t, which, torque, cutoff) for t in identification.traces])
        drawn.append(points(*cloud(x, y, CLOUD_POINTS), NAMES[which], COLORS[which], panel))
        mean = binned_mean(x, y)
        drawn.append(lines(*mean, f"mean, {NAMES[which]}", COLORS[which], panel, width=3))
    panels = [Panel(axis(name, unit), title, NAMES[which]) for which in models]
    return Figure(
        label=f"Residual against {name}, before and after",
        caption=f"Residual against {name}: a sample of the points and their mean. Where the mean leaves zero, "
        f"the model lacks something that depends on the {name}.",
        traces=drawn,
        layout=grid(panels, columns=len(models), gap=0.1) | {"showlegend": False},
        height=300,
    )


def _by_direction(identification: Identification) -> Figure:
    """Residual against angle, motion one way and the other apart: friction and loops open a gap between the two."""
    quantities, (title, torque) = QUANTITIES[identification.axis], _titled(identification)
    models, drawn = _models(identification), []
    cutoff = identification.final.error.lowpass_hz
    x = np.concatenate([t.angle_rad for t in identification.traces])
    forward = np.concatenate([t.rate_rad_s for t in identification.traces]) > 0.0
    for panel, which in enumerate(models, 1):
        y = np.concatenate([_residual(t, which, torque, cutoff) for t in identification.traces])
        for way, name, color in ((forward, "forward", FORWARD), (~forward, "backward", BACKWARD)):
            here = np.where(way, y, np.nan)
            drawn.append(points(*cloud(x, here, CLOUD_POINTS // 2), name, color, panel, showlegend=False))
            drawn.append(lines(*binned_mean(x, here), f"mean, {name}", color, panel, width=3))
    panels = [Panel(axis(quantities.angle, quantities.angle_unit), title, NAMES[which]) for which in models]
    return Figure(
        label=f"Residual against {quantities.angle} for either direction of motion, before and after",
        caption=f"The same by direction of motion: positive {quantities.rate} (forward) and negative (backward). Two "
        "means that part show friction or a loop; two that run together show a spring, gravity or cogging.",
        traces=once_in_legend(drawn),
        layout=grid(panels, columns=len(models), gap=0.1),
        height=300,
    )


def _marks(identification: Identification, which: Which, hertz: Array, density: Array) -> list[Trace]:
    """Multiples of the played tones that stand out of the residual, on its curve, odd and even apart."""
    found = identification.residual_before if which == "before" else identification.residual_after
    if found is None or found.harmonics is None or len(hertz) < 2:
        return []
    tones = sorted({t.frequency_hz for t in identification.traces if t.frequency_hz})
    out = []
    for name, color, rest in (("odd harmonics", ODD, 1), ("even harmonics", EVEN, 0)):
        at = np.array([k * f for f in tones for k in found.harmonics.orders if k % 2 == rest and k * f < hertz[-1]])
        if len(at):
            values = np.interp(at, hertz, np.sqrt(density))
            drawn = points(at, values, name, color, size=8, opacity=0.9)
            drawn["marker"]["symbol"] = "triangle-up" if rest else "square"
            out.append(drawn)
    return out


def _free_lines(identification: Identification) -> tuple[list[dict[str, object]], list[dict[str, object]]]:
    """Shapes and names of the lines that no excitation makes, of the model that shows them last."""
    both = [d for d in (identification.residual_before, identification.residual_after) if d is not None]
    free = {round(line.frequency_hz, 1): line.frequency_hz for d in both for line in d.free_lines}
    shapes = [upright(f, FREE) for f in free.values()]
    place = {"yref": "paper", "yanchor": "bottom", "xanchor": "center", "showarrow": False, "font": {"size": 10}}
    names = [{"text": f"{f:.4g} Hz, free", "x": float(np.log10(f)), "y": 1.0, **place} for f in free.values()]
    return shapes, names


def spectrum(traces: Sequence[RunTraces], which: Which) -> tuple[Array, Array]:
    """Power density of measured less simulated, averaged over the runs: frequencies (m,) in Hz, density (m,) per Hz.

    Samples that do not count are zero and made up for by the rest. Runs of different rate meet on the
    coarsest common grid.
    """
    found, weights = [], []
    for trace in traces:
        simulated = trace.simulated_before if which == "before" else trace.simulated_after
        left = left_over(trace, simulated)
        known = np.isfinite(left)
        if len(left) < 16 or not known.any():
            continue
        rate = (len(left) - 1) / float(trace.time_s[-1] - trace.time_s[0])
        hertz, density = signal.welch(np.where(known, left, 0.0), rate, nperseg=min(SEGMENT, len(left)), detrend=False)
        found.append((hertz[1:], density[1:] / known.mean()))
        weights.append(float(known.sum()))
    if not found:
        return np.empty(0), np.empty(0)
    common = min((hertz for hertz, _ in found), key=lambda h: (float(h[-1]), len(h)))
    stacked = np.array([np.interp(common, hertz, density) for hertz, density in found])
    return common, np.average(stacked, axis=0, weights=weights)


def _spectrum(identification: Identification) -> Figure:
    quantities, traces = QUANTITIES[identification.axis], identification.traces
    unit = quantities.measured(traces[0])[1]
    drawn = []
    for which in _models(identification):
        hertz, density = spectrum(traces, which)
        drawn.append(lines(hertz, np.sqrt(density), NAMES[which], COLORS[which], width=1.3))
        drawn += _marks(identification, which, hertz, density)
    steps = [float(t.time_s[-1] - t.time_s[0]) / max(1, len(t.time_s) - 1) for t in traces]
    white = identification.noise_floor.holdout_rate_rms * float(np.sqrt(2.0 * np.median(steps)))
    panel = Panel(
        "frequency (Hz)",
        f"error density ({unit} / √Hz)",
        x_log=True,
        y_log=True,
        extra_x={"dtick": 1},
        extra_y={"dtick": 1},
    )
    layout = grid([panel])
    shapes, names = _free_lines(identification)
    layout["shapes"] = [*([level(white, FLOOR)] if white > 0.0 else []), *shapes]
    layout["annotations"] += names
    return Figure(
        label="Residual against frequency, before and after, with the noise floor, harmonics and free lines",
        caption="Amplitude density of measured less simulated. Dashed green: white noise of the sensor's own size; "
        "what stands above it at some frequency is motion that the model does not have. Triangles and squares: odd and "
        "even multiples of a played tone that stand out. Dotted: a line that belongs to no set's excitation.",
        traces=once_in_legend(drawn),
        layout=layout,
        height=330,
    )
