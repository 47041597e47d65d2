"""How the genetic algorithm converged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from identify.report.captions import BELOW_J_DEC, SEARCH_REPEATS
from identify.report.page.markup import Markup, table
from identify.report.page.plots.figure import (
    AFTER,
    FLOOR,
    SETS,
    Figure,
    Panel,
    Trace,
    grid,
    level,
    lines,
    once_in_legend,
)
from identify.results import GeneticRun, Identification
from identify.wording import SYMBOLS, number, plain

ROUNDING_FLOOR = 1e-13  # relative: what double precision leaves


def genetic_runs(identification: Identification) -> list[GeneticRun]:
    """All sets together first, then every set for itself."""
    joint = [identification.joint] if identification.joint else []
    return joint + [one.genetic for one in identification.per_set if one.genetic]


def convergence_figure(identification: Identification) -> Figure | None:
    """Objective against generation, beside J_dec and beside the closed-form optimum."""
    runs = [run for run in genetic_runs(identification) if len(run.history)]
    if not runs:
        return None
    drawn: list[Trace] = []
    for i, run in enumerate(runs):
        joint = run is identification.joint
        color, width = (AFTER, 2.6) if joint else (SETS[i % len(SETS)], 1.1)
        generation = np.arange(1, len(run.history) + 1, dtype=float)
        drawn.append(lines(generation, run.history / run.j_dec, run.name, color, width=width))
        if run.closed_form_objective is not None and run.closed_form_objective > 0.0:
            excess = np.maximum(run.history / run.closed_form_objective - 1.0, ROUNDING_FLOOR)
            drawn.append(lines(generation, excess, run.name, color, 2, width=width))
    panels = [
        Panel("generation", "objective / J_dec", "objective against J_dec (Eq. 14)", y_log=True, extra_y={"dtick": 1}),
        Panel("generation", "objective / optimum - 1", "excess over the closed-form optimum", y_log=True),
    ]
    known = any(trace["yaxis"] == "y2" for trace in drawn)
    layout = grid(panels if known else panels[:1], columns=2 if known else 1, gap=0.12)
    layout["shapes"] = [level(1.0, FLOOR)]
    first = runs[0]
    if first.closed_form_objective:
        layout["shapes"].append(level(first.closed_form_objective / first.j_dec, color="#8a919b", dash="dot"))
    return Figure(
        label="Genetic algorithm: objective against generation, with J_dec and the closed-form optimum",
        caption=(
            "Best individual of each generation, without local refinement. Dashed green: J_dec; a run below it is "
            f"accepted. Dotted grey: closed-form optimum of {first.name}."
        ),
        traces=once_in_legend(drawn),
        layout=layout,
        height=330,
    )


def convergence_table(identification: Identification) -> Markup:
    """Best individual against the closed form, and what Eq. 13 alone and plain equation error would have given."""
    runs = genetic_runs(identification)
    if not runs:
        return Markup("")
    names = list(runs[0].closed_form)
    symbols = ", ".join(SYMBOLS.get(name, plain(name)) for name in names)
    head = ["search", "objective", "J_dec", SEARCH_REPEATS, BELOW_J_DEC]
    head += [f"{which}: {symbols} (%)" for which in ("gap", "Eq. 13 alone", "plain error")]
    rows = []
    for run in runs:
        passed = "yes" if run.accepted else "NO"
        gaps = [run.gap_percent.get(name) for name in names]
        alone = [_off(run.roulette_only, run.closed_form, name) for name in names]
        rough = [_off(run.plain_objective, run.closed_form, name) for name in names]
        values = [_each(several) for several in (gaps, alone, rough)]
        rows.append([run.name, number(run.objective), number(run.j_dec), str(run.restarts), passed, *values])
    caption = (
        "Distance of the best individual from the closed-form optimum, in percent: with elitism and a shrinking "
        "mutation step; with the roulette of Eq. 13 alone; and with e(k) as plain equation error instead of rate units."
    )
    return table(head, rows, caption)


def _off(values: Mapping[str, float], closed: Mapping[str, float], name: str) -> float | None:
    if name not in values or not closed.get(name):
        return None
    return 100.0 * abs(values[name] / closed[name] - 1.0)


def _each(several: Sequence[float | None]) -> str:
    return "-" if all(value is None for value in several) else ", ".join(_percent(value) for value in several)


def _percent(value: float | None) -> str:
    if value is None or not np.isfinite(value):
        return "-"
    return "< 1e-6" if value < 1e-6 else number(value, 2)
