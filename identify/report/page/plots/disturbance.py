"""What is left after the final model, as a torque: its size, what it depends on, and the shape of each such part."""

from __future__ import annotations

import numpy as np

from identify.report.page.markup import Markup, Piece, table
from identify.report.page.plots.figure import AFTER, Figure, Panel, grid, lines, points
from identify.report.page.quantities import QUANTITIES, axis
from identify.residual import Dependence
from identify.results import Identification
from identify.wording import depends_on, number, quantities_of, quantity_of

# Sign of the rate, and half a step of room on either side of the axis.
DIRECTIONS = {"tickvals": [-1, 1], "ticktext": ["backward", "forward"], "range": [-1.5, 1.5]}
LEAST_RATE = 1e-6  # below it how small a false-alarm rate is tells nothing: the test is not exact that far out
MIN_FOR_A_CURVE = 3  # points: fewer are drawn as points


def disturbance_table(identification: Identification) -> Markup:
    """Size and share of the torque that is left and of what it depends on; nothing without a torque."""
    left, q = identification.disturbance, QUANTITIES[identification.axis]
    if left is None:
        return Markup("")
    rows: list[list[Piece]] = [["total", number(left.torque_rms, 2), number(100.0 * left.relative, 2), ""]]
    rows += [
        [
            f"depends on the {quantity_of(d, identification.axis)}", number(d.torque_rms, 2),
            number(100.0 * d.relative, 2), _rate(d.false_alarm),
        ]
        for d in left.depends_on
    ]  # fmt: skip
    return table(
        ["", f"rms ({q.torque_unit})", f"% of the {q.torque}", "false-alarm rate"],
        rows,
        f"The residual {q.torque} of the final model, without the sensor's noise. A part that depends on a quantity "
        "is missing from the model; the rest is noise and is included in the intervals.",
    )


def _rate(false_alarm: float) -> str:
    return f"< {LEAST_RATE:g}" if false_alarm < LEAST_RATE else number(false_alarm, 1)


def shape_figure(identification: Identification) -> Figure | None:
    """One panel for each free-form term that was found; None where none has a shape."""
    left, q = identification.disturbance, QUANTITIES[identification.axis]
    shown = [d for d in left.depends_on if len(d.at)] if left is not None else []
    if not shown:
        return None
    drawn, panels = [], []
    for panel, term in enumerate(shown, 1):
        x, y = np.array(term.at), np.array(term.shape_nm)
        draw = lines if len(x) >= MIN_FOR_A_CURVE else points
        size = {"width": 2.2} if draw is lines else {"size": 10, "opacity": 1.0}
        drawn.append(draw(x, y, f"depends on the {quantity_of(term, identification.axis)}", AFTER, panel, **size))
        ticks = {"zeroline": True} | (DIRECTIONS if term.on == "direction" else {})
        titles = _x_title(term, identification.axis), axis(q.torque, q.torque_unit)
        panels.append(Panel(*titles, extra_x=ticks, extra_y={"zeroline": True}))
    names = quantities_of(shown, identification.axis)
    columns = min(2, len(panels))
    return Figure(
        label=f"Residual {q.torque} against {names}: fitted shape",
        heading="Shape of the missing effect",
        caption=(
            f"A free-form term (spline) of the residual {q.torque}, fitted together with the final model. Its "
            "constant and linear parts are omitted, because the model's own terms contain them."
        ),
        traces=drawn,
        layout=grid(panels, columns=columns, gap=0.12) | {"showlegend": False},
        height=110 + 210 * -(-len(panels) // columns),
    )


def _x_title(term: Dependence, kind: str) -> str:
    q = QUANTITIES[kind]
    units = {"angle": q.angle_unit, "rate": q.rate_unit, "torque": q.torque_unit}
    if term.on in units:
        return axis(depends_on(term.on, kind), units[term.on])
    return {"time": "time since the start of the run (s)", "direction": "direction of motion"}.get(term.on, term.on)
