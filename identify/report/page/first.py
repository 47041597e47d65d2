"""The first screen: three sentences, the error before and after, and the plot that convinces."""

from __future__ import annotations

import math

import numpy as np

from identify.conclude.headline import error_before_and_after, headline
from identify.report.page.document import Gallery
from identify.report.page.markup import Markup, element, paragraph, section, words
from identify.report.page.plots.figure import AFTER, BEFORE, FLOOR, MEASURED, Figure, Panel, grid, level, lines
from identify.report.page.plots.residual import residual_of
from identify.report.page.quantities import QUANTITIES, axis
from identify.results import Identification, RunTraces
from identify.wording import (
    SYMBOLS,
    bias_percent,
    half_interval,
    half_of,
    number,
    percent,
    plain,
    unbroken,
    unit,
    value_of,
)
from rig.arrays import Array

SHOWN_PERIODS = 3.0  # of the excitation that are shown
RUN_SHARE, MIN_SHOWN_SAMPLES = 0.05, 200  # of a run without a frequency, and samples
ROOM = 1.35  # of the measured motion: a simulation that runs away leaves the plot
POWER_WHEN_STILL = 1.0  # of the mean power of what was measured: a moment at rest counts as one with that much
LEAST_RANGE = 0.1  # of the largest that was measured, which a plot shows at least


def first_screen(found: Identification, gallery: Gallery) -> Markup:
    """What somebody reads who reads nothing else."""
    return section(
        "found",
        "What was found",
        element("div", *[paragraph(words(text)) for text in headline(found)], class_="sentences"),
        element("div", *_error_tile(found), *_parameter_tiles(found), class_="tiles"),
        gallery.place(convincing_figure(found)),
    )


def _error_tile(found: Identification) -> list[Markup]:
    old, new, floor, its_unit = error_before_and_after(found)
    if new is None:
        return []
    arrow = f"{number(old, 3)} → " if found.after is not None and old is not None else ""
    return [
        element(
            "div",
            element("span", "error", class_="symbol word"),
            element("span", f"{arrow}{number(new, 3)}", element("small", f" {its_unit}"), class_="value"),
            element("span", "on held-out data, declared → final model" if arrow else "on held-out data", class_="half"),
            element("span", f"noise floor {number(floor, 3)} {its_unit}" if floor else "", class_="bent"),
            class_="tile wide",
        )
    ]


def _parameter_tiles(found: Identification) -> list[Markup]:
    bent, tiles = bias_percent(found), []
    for name, estimate in found.final.parameters.items():
        half = half_interval(estimate)
        before = f"by the declared model: {percent(bent[name])}" if name in bent else ""
        tiles.append(
            element(
                "div",
                element("span", SYMBOLS.get(name, plain(name)), class_="symbol"),
                element("span", value_of(estimate), element("small", f" {unit(estimate.unit)}"), class_="value"),
                element("span", f"± {half_of(estimate)} (95 %)" if math.isfinite(half) else "", class_="half"),
                element("span", unbroken(before), class_="bent"),
                class_="tile",
            )
        )
    return tiles


def convincing_figure(found: Identification) -> Figure | None:
    """Measured beside both models over the moment at which the two differ most; None without runs.

    In torque where the torque decided: a free run accumulates every torque that nobody recorded.
    """
    by_torque = found.final.error.holdout_measure == "holdout_torque_relative"
    lowpass_hz = found.final.error.lowpass_hz
    several = [(t, shown) for t in found.traces if (shown := _channels(t, by_torque, lowpass_hz)) is not None]
    if not several:
        return None
    places = [(_strongest(t, *shown), i) for i, (t, shown) in enumerate(several)]
    (_, start, end), at = max(places, key=lambda p: p[0][0])
    trace, channels = several[at]
    range_ = ROOM * max(_largest(channels[0][start:end]), LEAST_RANGE * _largest(channels[0]))
    return _figure(found, trace, [c[start:end] for c in channels], (start, end), by_torque, range_ or 1.0)


def _largest(measured: Array) -> float:
    """The largest finite size of what was measured; zero where there is none."""
    return float(np.max(np.abs(measured[np.isfinite(measured)]), initial=0.0))


def _channels(trace: RunTraces, by_torque: bool, lowpass_hz: float | None) -> tuple[Array, Array, Array] | None:
    """Measured, by the declared and by the final model, each (n,): the motion, or the torque along the motion.

    NaN where the low-pass of the torque residual has not settled: the ends of a run are no error of a model.
    """
    if not by_torque:
        return trace.measured, trace.simulated_before, trace.simulated_after
    if trace.torque_nm is None or trace.torque_residual_before is None or trace.torque_residual_after is None:
        return None
    torque = trace.torque_nm
    before, after = (torque - residual_of(trace, which, True, lowpass_hz) for which in ("before", "after"))
    return torque, before, after


def _strongest(trace: RunTraces, measured: Array, before: Array, after: Array) -> tuple[float, int, int]:
    """Where the two models differ most, over the size of the measured there: (ratio, first, end)."""
    count = len(measured)
    step = float(trace.time_s[-1] - trace.time_s[0]) / max(count - 1, 1)
    span = SHOWN_PERIODS / trace.frequency_hz / step if trace.frequency_hz else RUN_SHARE * count
    width = int(min(count, max(span, MIN_SHOWN_SAMPLES)))
    size = _largest(measured) or 1.0
    same = np.array_equal(before, after)
    differ = np.clip(np.nan_to_num(before - (measured if same else after)), -size, size)
    differ, moved = np.where(trace.keep > 0.0, differ, 0.0), np.nan_to_num(measured)
    power, of_motion = (_moving_mean(x * x, width) for x in (differ, moved))
    ratio = power / (of_motion + POWER_WHEN_STILL * np.mean(moved**2) + 1e-300)
    first = int(np.argmax(ratio))
    return float(ratio[first]), first, first + width


def _moving_mean(x: Array, width: int) -> Array:
    whole = np.concatenate([[0.0], np.cumsum(x)])
    return np.asarray((whole[width:] - whole[:-width]) / width)


def _figure(
    found: Identification, trace: RunTraces, channels: list[Array], place: tuple[int, int], by_torque: bool,
    range_: float,
) -> Figure:  # fmt: skip
    """The figure; ``range_`` is how far its first panel reaches to either side of zero."""
    q = QUANTITIES[found.axis]
    name, its_unit = (q.torque, q.torque_unit) if by_torque else q.measured(trace)
    time = (trace.time_s - trace.time_s[0])[slice(*place)]
    measured, before, after = channels
    two = found.after is not None
    drawn = [
        lines(time, measured, "measured", MEASURED, width=5, opacity=0.55),
        lines(time, before, "declared model", BEFORE, width=1.8, dash="dash" if two else "solid"),
        lines(time, measured - before, "declared model", BEFORE, 2, showlegend=False),
    ]
    if two:
        drawn += [
            lines(time, after, "final model", AFTER, width=1.8),
            lines(time, measured - after, "final model", AFTER, 2, showlegend=False),
        ]
    panels = [
        Panel("", axis(name, its_unit), extra_y={"range": [-range_, range_]}),
        Panel("time since the start of the run (s)", axis("error", its_unit), "measured minus model"),
    ]
    layout = grid(panels, shared_x=True, gap=0.16)
    floor = found.noise_floor.residual_rms_torque if by_torque else found.noise_floor.holdout_rate_rms
    if floor:
        layout["shapes"] = [level(sign * 2.0 * floor, FLOOR, 2) for sign in (-1, 1)]
    models = "the two models differ" if two else "the model errs"
    return Figure(
        label=f"Measured {name} and the models' in run {trace.name}, where {models} most",
        caption=f"Run {trace.name}, where {models} most. Dashed green: twice the sensor's noise.",
        traces=drawn,
        layout=layout,
        height=360,
    )
