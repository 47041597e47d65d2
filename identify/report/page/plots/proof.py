"""The proof: measured against linear model, before and after compensation, set by set."""

from __future__ import annotations

from identify.proof.wording import lines as proof_lines
from identify.proven import Proof, ProofLines
from identify.report.page.document import Gallery
from identify.report.page.markup import Markup, bullets, section
from identify.report.page.plots.figure import AFTER, BEFORE, FLOOR, Figure, Panel, grid, level, lines, once_in_legend
from identify.report.page.plots.thinning import line
from identify.report.page.quantities import QUANTITIES, axis
from identify.results import Identification

PROOF_LINE_POINTS = 2500  # of one line
PROOF_PANEL_PX = 190  # height of a panel


def proof_section(identification: Identification, gallery: Gallery) -> Markup:
    """The section of the proof; empty where none was played."""
    proof = identification.proof
    if proof is None:
        return Markup("")
    figure = [gallery.place(proof_figure(identification, proof))] if proof.lines else []
    return section("proof", "Proof: the named effects cancelled on the rig", bullets(proof_lines(proof)), *figure)


def proof_figure(identification: Identification, proof: Proof) -> Figure:
    """Measured less linear model without and with compensation, a panel a set."""
    name, unit = QUANTITIES[identification.axis].measured(identification.traces[0])
    panels, drawn = [], []
    noise = {s.set: s.noise for s in proof.total.sets}
    shapes = []
    for number, one in enumerate(proof.lines, 1):
        last = number == len(proof.lines)
        panels.append(Panel("time since the start of the set (s)" if last else "", axis("error", unit), one.set))
        drawn += _of_set(one, number)
        shapes += [level(sign * 2.0 * noise.get(one.set, 0.0), FLOOR, number) for sign in (-1, 1)]
    layout = grid(panels, gap=0.08)
    layout["shapes"] = shapes
    return Figure(
        label=f"Measured {name} minus the linear model, without and with the compensating torque, for each set",
        heading="Measured against the linear model",
        caption="Dashed green: twice the noise of the sensor. Linear model: J, C and K alone, given the same set.",
        traces=once_in_legend(drawn),
        layout=layout,
        height=PROOF_PANEL_PX * len(panels) + 60,
    )


def _of_set(one: ProofLines, panel: int) -> list[dict[str, object]]:
    return [
        lines(*line(one.time_s, one.without, PROOF_LINE_POINTS), "without compensation", BEFORE, panel, width=0.9),
        lines(*line(one.time_s, one.compensated, PROOF_LINE_POINTS), "with compensation", AFTER, panel, width=0.9),
    ]
