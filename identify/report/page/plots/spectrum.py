"""The spectrum of what the model leaves: of the torque and of the motion, beside what the sensor's noise makes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import signal
from scipy.stats import chi2

from identify.report.page.plots.figure import (
    FLOOR,
    NOISE,
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
from identify.report.page.plots.residual import COLORS, NAMES, Which, models_of, residual_of, torque_known
from identify.report.page.quantities import QUANTITIES
from identify.results import Identification, RunTraces
from rig.platform import Platform
from rig.recording.run import Array

MAX_WELCH_SAMPLES = 4096  # samples of one Welch segment at most
INDEPENDENT_SEGMENT_SHARE = 0.5  # of the segments, which overlap by half
CONFIDENCE = 0.95  # of the band of noise
ODD, EVEN, FREE = SETS[7], SETS[1], SETS[6]


def spectrum_figures(identification: Identification) -> list[Figure]:
    """Spectrum of the torque residual, where there is a torque, and of the motion's error."""
    traces = identification.traces
    if not traces:
        return []
    torque = torque_known(traces) and identification.final.platform is not None
    return [*([_of_torque(identification)] if torque else []), _of_motion(identification)]


def spectrum(
    traces: Sequence[RunTraces], which: Which, torque: bool = False, lowpass_hz: float | None = None
) -> tuple[Array, Array]:
    """Power density of a residual, averaged over the runs: frequencies (m,) in Hz, density (m,) per Hz.

    Of measured less simulated, or of the torque residual behind the low-pass. Samples that do not count are zero and
    made up for by the rest. Runs of different rate meet on the coarsest common grid.
    """
    found, weights = [], []
    for trace in traces:
        left = residual_of(trace, which, torque, lowpass_hz)
        known = np.isfinite(left)
        if len(left) < 16 or not known.any():
            continue
        rate = (len(left) - 1) / float(trace.time_s[-1] - trace.time_s[0])
        hertz, density = signal.welch(
            np.where(known, left, 0.0), rate, nperseg=min(MAX_WELCH_SAMPLES, len(left)), detrend=False
        )
        found.append((hertz[1:], density[1:] / known.mean()))
        weights.append(float(known.sum()))
    if not found:
        return np.empty(0), np.empty(0)
    common = min((hertz for hertz, _ in found), key=lambda h: (float(h[-1]), len(h)))
    stacked = np.array([np.interp(common, hertz, density) for hertz, density in found])
    return common, np.average(stacked, axis=0, weights=weights)


def noise_band(identification: Identification, hertz: Array) -> tuple[Array, Array]:
    """Where the sensor's noise alone would put the torque's density at each frequency: low and high, N m / sqrt(Hz).

    White noise of the sensor's size, sent through the final platform backwards; the width is the chance of an average
    over so many segments.
    """
    traces, platform = identification.traces, identification.final.platform
    assert platform is not None
    white = identification.noise_floor.holdout_rate_rms * float(np.sqrt(2.0 * np.median(_steps_s(traces))))
    density = white * np.abs(torque_per_reading(platform, hertz, traces[0].channel))
    segments = sum(max(1.0, 2.0 * len(t.time_s) / MAX_WELCH_SAMPLES - 1.0) for t in traces)
    freedom = 2.0 * max(1.0, INDEPENDENT_SEGMENT_SHARE * segments + 0.5)
    low, high = (float(np.sqrt(chi2.ppf(q, freedom) / freedom)) for q in (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2))
    return low * density, high * density


def torque_per_reading(platform: Platform, hertz: Array, channel: str) -> Array:
    """Torque that J, C and K take for one unit of the measured channel, complex, (m,)."""
    s = 2j * np.pi * hertz
    per_rate = platform.inertia_kg_m2 * s + platform.damping_nm_s_rad + platform.stiffness_nm_rad / s
    return np.asarray(per_rate if channel == "rate" else per_rate * s)


def _steps_s(traces: Sequence[RunTraces]) -> list[float]:
    return [float(t.time_s[-1] - t.time_s[0]) / max(1, len(t.time_s) - 1) for t in traces]


def _of_torque(identification: Identification) -> Figure:
    q, traces = QUANTITIES[identification.axis], identification.traces
    cutoff, drawn = identification.final.error.lowpass_hz, []
    hertz: Array = np.empty(0)
    for which in models_of(identification):
        hertz, density = spectrum(traces, which, True, cutoff)
        inside = hertz <= (cutoff or np.inf)
        hertz = hertz[inside]
        drawn.append(lines(hertz, np.sqrt(density[inside]), NAMES[which], COLORS[which], width=1.3))
        drawn += _marks(identification, which, hertz, density[inside])
    low, high = noise_band(identification, hertz)
    name = "noise of the sensor"
    drawn.append(lines(hertz, low, name, FLOOR, width=0.5))
    drawn.append(lines(hertz, high, name, FLOOR, width=0.5) | {"fill": "tonexty", "fillcolor": NOISE})
    layout = grid([_panel(f"{q.torque} residual density ({q.torque_unit} / √Hz)")])
    shapes, names = _free_lines(identification)
    layout["shapes"] = shapes
    layout["annotations"] += names
    return Figure(
        label=f"Spectrum of the {q.torque} residual, before and after, with the band of the sensor's noise",
        caption=(
            f"Amplitude density of the {q.torque} residual, up to the low-pass. Green: the band of white noise of the "
            f"sensor's rms ({100 * CONFIDENCE:.0f} %). A density above the band is a {q.torque} that was not recorded "
            "or is missing from the model."
        ),
        traces=once_in_legend(drawn),
        layout=layout,
        height=330,
    )


def _panel(y_title: str) -> Panel:
    return Panel("frequency (Hz)", y_title, x_log=True, y_log=True, extra_x={"dtick": 1}, extra_y={"dtick": 1})


def _of_motion(identification: Identification) -> Figure:
    quantities, traces = QUANTITIES[identification.axis], identification.traces
    unit = quantities.measured(traces[0])[1]
    drawn = []
    for which in models_of(identification):
        hertz, density = spectrum(traces, which)
        drawn.append(lines(hertz, np.sqrt(density), NAMES[which], COLORS[which], width=1.3))
        drawn += _marks(identification, which, hertz, density)
    white = identification.noise_floor.holdout_rate_rms * float(np.sqrt(2.0 * np.median(_steps_s(traces))))
    layout = grid([_panel(f"error density ({unit} / √Hz)")])
    shapes, names = _free_lines(identification)
    layout["shapes"] = [*([level(white, FLOOR)] if white > 0.0 else []), *shapes]
    layout["annotations"] += names
    return Figure(
        label="Residual against frequency, before and after, with the noise floor, harmonics and free lines",
        caption=(
            "Amplitude density of measured minus simulated motion. Dashed green: white noise of the sensor's rms; a "
            "density above it is motion that is missing from the model. Triangles and squares: significant odd and "
            "even harmonics of an excitation frequency. Dotted: a line that is not a harmonic of any excitation."
        ),
        traces=once_in_legend(drawn),
        layout=layout,
        height=330,
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
