"""The frequency response from torque to rate: measured, with its coherence, and of the model before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identify.frequency.measured_response import measured_response
from identify.frequency.model_response import Size, linear_response
from identify.frequency.spectra import MAX_GAIN_ERROR, MIN_COHERENCE, Complex, Record, Response, decibel
from identify.report.page.plots.figure import (
    AFTER,
    BEFORE,
    MEASURED,
    Figure,
    Panel,
    Trace,
    grid,
    level,
    lines,
    once_in_legend,
    points,
)
from identify.report.page.quantities import QUANTITIES
from identify.results import Identification, RunTraces
from identify.wording import joined, plain
from rig.platform import Platform
from rig.recording.run import Array, Recording, Run

MIN_COUNTED_SHARE = 0.95  # share of a run's samples that have to count for its simulation to be one piece
REPEAT_TOLERANCE = 1e-3  # relative: torques closer than this are repeats of one set
SETTLING_TIME_CONSTANTS = 4.0  # time constants after which a start transient is taken to be over (2 % are left)
FINE = 700  # frequencies of a drawn line
LINE_SPAN_RATIO = 1.3  # the line goes on to this many times the highest and lowest measured frequency
TICKS_HZ = [digit * 10.0**decade for decade in range(-3, 4) for digit in (1, 2, 5)]  # Hz, 1 mHz to 5 kHz
HOW = {
    "whole periods": "over whole periods, without the first",
    "segments": "over half-overlapping segments",
    "local polynomial": "by local polynomials over the whole record",
}


@dataclass(frozen=True)
class SetResponse:
    """One set, its repeats averaged: as measured, and as the models' simulations give it by the same estimate."""

    name: str
    measured: Response
    before: Response | None
    after: Response | None


def set_responses(identification: Identification, recording: Recording) -> list[SetResponse]:
    """The measured response of every set with torque, in the order played."""
    runs = {run.name: run for run in recording.runs}
    settle = settle_s(identification.final.platform)
    out = []
    for repeats in _repeats([t for t in identification.traces if t.torque_nm is not None]):
        first = repeats[0]

        def of(which: str, repeats: Sequence[RunTraces] = repeats) -> Response | None:
            if which != "measured" and any(float(np.mean(t.keep)) < MIN_COUNTED_SHARE for t in repeats):
                return None  # a simulation that begins anew behind every gap jumps there
            records = [_record(t, getattr(t, which), runs.get(t.name)) for t in repeats]
            return measured_response(records, settle)

        measured = of("measured")
        if measured is not None:
            before, after = of("simulated_before"), of("simulated_after")
            out.append(SetResponse(first.name, measured, _same_lines(before, measured), _same_lines(after, measured)))
    return out


def settle_s(platform: Platform | None) -> float:
    """How long the start of a run rings."""
    if platform is None or platform.damping_nm_s_rad <= 0.0 or platform.inertia_kg_m2 <= 0.0:
        return 0.0
    return SETTLING_TIME_CONSTANTS * 2.0 * platform.inertia_kg_m2 / platform.damping_nm_s_rad


def _same_lines(found: Response | None, measured: Response) -> Response | None:
    """Nothing where the estimate from the simulation holds other lines (it ran away)."""
    same = found is not None and np.array_equal(found.frequency_hz, measured.frequency_hz)
    return found if same else None


def _repeats(traces: Sequence[RunTraces]) -> list[list[RunTraces]]:
    groups: list[list[RunTraces]] = []
    for trace in traces:
        group = next((g for g in groups if _alike(g[0], trace)), None)
        if group is None:
            groups.append([trace])
        else:
            group.append(trace)
    return groups


def _alike(one: RunTraces, other: RunTraces) -> bool:
    a, b = one.torque_nm, other.torque_nm
    if a is None or b is None or len(a) != len(b) or one.channel != other.channel:
        return False
    if abs(_step(one) - _step(other)) > 1e-9 * _step(one):
        return False
    return bool(np.linalg.norm(a - b) < REPEAT_TOLERANCE * np.linalg.norm(a))


def _step(trace: RunTraces) -> float:
    return float(trace.time_s[-1] - trace.time_s[0]) / max(1, len(trace.time_s) - 1)


def _record(trace: RunTraces, motion: Array, run: Run | None) -> Record:
    """``motion`` replaces the measured one; a torque that is held acts later than its samples say."""
    step = _step(trace)
    held = 0.0
    if run is not None and run.torque_hold == "zero_order" and run.torque_time_s is not None:
        held = min(step, float(np.median(np.diff(run.torque_time_s))))
    assert trace.torque_nm is not None
    return Record(trace.torque_nm, motion, step, held, trace.channel == "angle")


def response_figure(identification: Identification, recording: Recording) -> Figure | None:
    """Gain, phase, deviation and coherence against frequency; None without torque."""
    sets = set_responses(identification, recording)
    final = identification.final.platform
    if not sets or final is None or final.inertia_kg_m2 <= 0.0:
        return None
    size = _size(identification.traces)
    models = {"declared model": (identification.before.platform, BEFORE)}
    if identification.after is not None:
        models["final model"] = (final, AFTER)
    f = _frequencies(sets, final)
    curves = {name: linear_response(p, f, size) for name, (p, _) in models.items() if p is not None}
    phase_of = curves[list(curves)[-1]][0]
    drawn: list[Trace] = []
    for name, (response, _) in curves.items():
        color = models[name][1]
        drawn.append(lines(f, decibel(response), name, color, 1, width=1.6))
        drawn.append(lines(f, _unwrapped(response), name, color, 2, width=1.6))
    left_out = list(curves.values())[-1][1]
    for one in sets:
        drawn += _measured_points(one, f, phase_of)
        drawn += _model_points(one, f, phase_of, identification.after is not None, bool(left_out))
    return _figure(identification, sets, once_in_legend(drawn), left_out)


def _size(traces: Sequence[RunTraces]) -> Size:
    def rms(several: Sequence[Array]) -> float:
        return float(np.sqrt(np.mean(np.concatenate(several) ** 2)))

    torques = [t.torque_nm for t in traces if t.torque_nm is not None]
    return Size(
        rms([t.angle_rad - np.mean(t.angle_rad) for t in traces]), rms([t.rate_rad_s for t in traces]), rms(torques)
    )


def _frequencies(sets: Sequence[SetResponse], platform: Platform) -> Array:
    """Evenly over the logarithm, denser around the resonance where it lies in sight."""
    low = min(float(s.measured.frequency_hz[0]) for s in sets) / LINE_SPAN_RATIO
    high = max(float(s.measured.frequency_hz[-1]) for s in sets) * LINE_SPAN_RATIO
    natural = np.sqrt(max(platform.stiffness_nm_rad, 0.0) / platform.inertia_kg_m2) / (2.0 * np.pi)
    if low < natural < 4.0 * high:
        high = max(high, LINE_SPAN_RATIO * natural)
    f = np.geomspace(low, high, FINE)
    near = natural * (1.0 + np.sinh(np.linspace(-4.0, 4.0, 201)) / np.sinh(4.0) * 0.2)
    return np.unique(np.concatenate([f, near[(near > low) & (near < high)]]))


def _unwrapped(response: Complex) -> Array:
    """Phase in deg without jumps, beginning between -180 and 180."""
    return np.degrees(np.unwrap(np.angle(response)))


def _beside(response: Response, f: Array, model: Complex) -> Array:
    """Phase in deg on the turn that lies next to the model's."""
    there = np.interp(response.frequency_hz, f, _unwrapped(model))
    return response.phase_deg + 360.0 * np.round((there - response.phase_deg) / 360.0)


def _measured_points(one: SetResponse, f: Array, model: Complex) -> list[Trace]:
    found = one.measured
    out = []
    for trusted in (True, False):
        at = found.trusted == trusted
        if not np.any(at):
            continue
        name = "measured" if trusted else f"measured, coherence < {MIN_COHERENCE:g}"
        style = {"size": 6 if trusted else 5, "opacity": 0.95 if trusted else 0.45}
        phase = _beside(found, f, model)
        for panel, values, unit in ((1, found.gain_db, "dB"), (2, phase, "deg"), (4, found.coherence, "")):
            hover = f"{_shown(one.name)}<br>%{{x:.4g}} Hz: %{{y:.4g}} {unit}<extra></extra>"
            drawn = points(found.frequency_hz[at], values[at], name, MEASURED, panel, hovertemplate=hover, **style)
            out.append(drawn if trusted else drawn | {"marker": drawn["marker"] | {"symbol": "x-thin-open"}})
    return out


def _shown(name: str) -> str:
    """A name inside plotly's own markup."""
    return name.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("%{", "% {")[:40]


def _model_points(one: SetResponse, f: Array, phase_of: Complex, two: bool, amplitude: bool) -> list[Trace]:
    """How far each model's simulation is off, and the final one's own points where it is not linear."""
    out = []
    known = one.measured.trusted
    hertz = one.measured.frequency_hz[known]
    pairs = [("declared model", one.before, BEFORE)] + ([("final model", one.after, AFTER)] if two else [])
    for name, simulated, color in pairs:
        if simulated is None or not np.any(known):
            continue
        a, b = simulated.response[known], one.measured.response[known]
        off = 100.0 * np.abs(a - b) / np.maximum(np.abs(a), np.abs(b))
        out.append(points(hertz, np.maximum(off, 1e-4), name, color, 3, size=5, opacity=0.8, showlegend=False))
    last = pairs[-1]
    if amplitude and last[1] is not None and np.any(known):
        ring = {"symbol": "circle-open", "size": 9, "color": last[2], "line": {"width": 1.3}}
        simulated = last[1]
        for panel, values in ((1, simulated.gain_db), (2, _beside(simulated, f, phase_of))):
            drawn = points(hertz, values[known], f"{last[0]}, all effects", last[2], panel)
            out.append(drawn | {"marker": ring})
    return out


def _figure(
    identification: Identification, sets: Sequence[SetResponse], drawn: Sequence[Trace], left_out: Sequence[str]
) -> Figure:
    q = QUANTITIES[identification.axis]
    ratio = f"({q.rate_unit})/({q.torque_unit})" if "·" in q.torque_unit else f"({q.rate_unit})/{q.torque_unit}"
    panels = [
        Panel("", "gain (dB)", f"{q.rate} over {q.torque}, dB re 1 {ratio}", x_log=True),
        Panel("", "phase (deg)", x_log=True, extra_y={"dtick": 90}),
        Panel(
            "",
            "off by (%)",
            "each model's simulation against the measurement",
            x_log=True,
            y_log=True,
            extra_y={"dtick": 1},
        ),
        Panel("frequency (Hz)", "coherence", x_log=True, extra_y={"range": [-0.04, 1.06]}),
    ]
    layout = grid(panels, shared_x=True, gap=0.07)
    layout["xaxis4"] |= {"tickvals": TICKS_HZ, "ticktext": [f"{hz:g}" for hz in TICKS_HZ]}
    for number in ("", "2", "3"):
        layout[f"xaxis{number}"] |= {"tickvals": TICKS_HZ}
    layout["shapes"] = [level(MIN_COHERENCE, MEASURED, 4, dash="dot")]
    return Figure(
        label=f"Frequency response from {q.torque} to {q.rate}: gain, phase, deviation of the models and coherence",
        heading="",
        caption=_caption(sets, left_out),
        traces=drawn,
        layout=layout,
        height=760,
    )


def _caption(sets: Sequence[SetResponse], left_out: Sequence[str]) -> str:
    how = dict.fromkeys(HOW[s.measured.method] for s in sets)
    caption = f"Estimated {joined(list(how))}. Lines: J, C, K and the linear effects of each model. "
    if left_out:
        caption += (
            f"{joined([plain(n) for n in left_out])} depends on the amplitude and is not included in the lines: open "
            "circles show the simulation with all effects, estimated in the same way. "
        )
    pale = sum(int(np.sum(~s.measured.trusted)) for s in sets)
    caption += "Off by: difference between simulation and measurement, relative to the larger of the two. "
    caption += (
        f"Dotted: coherence {MIN_COHERENCE:g}. Pale crosses: coherence below it, or a standard error above "
        f"{100 * MAX_GAIN_ERROR:g} %"
    )
    return caption + (
        f" ({pale} of {sum(len(s.measured.frequency_hz) for s in sets)} points)." if pale else " (none here)."
    )
