"""The page as a whole: the verdict in words first, then what stands behind it."""

from __future__ import annotations

from collections.abc import Sequence

from identify.bounds.bound_and_estimate import compare_with_bound
from identify.conclude.expected_delay import delay_lines
from identify.conclude.next_steps import next_steps
from identify.diagnose.wording import diagnosis_sentences
from identify.follow_up.wording import lines as follow_up_lines
from identify.report.page.determined import determined_table
from identify.report.page.document import Gallery, document
from identify.report.page.findings import further_findings
from identify.report.page.first import first_screen
from identify.report.page.markup import Markup, Piece, bullets, element, folded, join, paragraph, section, words
from identify.report.page.origin import origin
from identify.report.page.plots.convergence import convergence_figure, convergence_table
from identify.report.page.plots.disturbance import disturbance_table, shape_figure
from identify.report.page.plots.estimates import estimates_figure
from identify.report.page.plots.motion import MAX_RUNS_DRAWN, motion_figures
from identify.report.page.plots.proof import proof_section
from identify.report.page.plots.residual import residual_figures
from identify.report.page.plots.response import response_figure
from identify.report.page.plots.spectrum import spectrum_figures
from identify.report.page.tables import (
    candidate_table,
    correlation_table,
    effect_cards,
    error_table,
    parameter_table,
    set_table,
)
from identify.results import Identification
from identify.wording import capital, not_said_yet, sentence
from rig.recording.run import Recording

KICKER = {"rotary": "Identification of an inertially stabilised platform", "linear": "Identification of a linear axis"}


def report_html(identification: Identification, recording: Recording, name: str) -> str:
    """report.html of one identification: self-contained, opens without a network.

    ``name`` is the campaign's. Plots are thinned to a few thousand points a line with all peaks kept.
    """
    gallery = Gallery()
    body = join(
        [
            _header(identification, name),
            first_screen(identification, gallery),
            _verdict(identification, recording, gallery),
            _errors(identification, recording, gallery),
            _candidates(identification),
            proof_section(identification, gallery),
            _response(identification, recording, gallery),
            _sets(identification, recording, gallery),
            _motion(identification, gallery),
            origin(recording),
        ]
    )
    return document(f"{name}: identification", body, gallery.figures)


def _header(identification: Identification, name: str) -> Markup:
    if identification.aborted:
        badge, state = "ABORTED: stopped early; based on what was complete by then", "bad"
    else:
        badge, state = ("ACCEPTED", "good") if identification.accepted else ("NOT ACCEPTED", "bad")
    return element(
        "header",
        element("p", KICKER[identification.axis], class_="kicker"),
        element("h1", name),
        element("p", badge, class_=f"badge {state}"),
    )


def _verdict(identification: Identification, recording: Recording, gallery: Gallery) -> Markup:
    final = identification.final
    steps = [words(step) for step in next_steps(identification)]
    why: list[Piece] = [words(capital(reason)) for reason in identification.reasons]
    reasons = [
        element(
            "div",
            *([element("h3", "Why it was not accepted"), bullets(why)] if why else []),
            *([element("h3", "Next"), bullets(steps)] if steps else []),
            class_="next",
        )
    ]
    return section(
        "verdict",
        "Findings and parameters",
        element(
            "div", *[paragraph(words(sentence)) for sentence in further_findings(identification)], class_="sentences"
        ),
        *(reasons if why or steps else []),
        parameter_table(identification),
        _titled("Torque delay", delay_lines(identification, recording.info)),
        _titled("Dropped: not supported by the data", not_said_yet(final.dropped, identification)),
        _titled("Not determined by these data", not_said_yet(final.not_determined, identification)),
        gallery.place(estimates_figure(identification)),
        effect_cards(identification),
        correlation_table(final.correlation),
    )


def _titled(heading: str, lines: Sequence[Piece]) -> Markup:
    return join([element("h3", heading), bullets(lines)]) if lines else Markup("")


def _errors(identification: Identification, recording: Recording, gallery: Gallery) -> Markup:
    drawn = [*residual_figures(identification), *spectrum_figures(identification)]
    figures = [gallery.place(figure) for figure in drawn]
    return section(
        "residual",
        "Residual",
        *_at_the_noise_floor(identification),
        disturbance_table(identification),
        gallery.place(shape_figure(identification)),
        error_table(identification, recording.info),
        paragraph(sentence(identification.holdout_note), class_="note"),
        *_residual_contents(identification),
        *figures,
    )


def _at_the_noise_floor(identification: Identification) -> list[Markup]:
    """That nothing is left; where something is, the verdict says how much."""
    by_torque = identification.final.error.holdout_measure == "holdout_torque_relative"
    if identification.verdict.unexplained or (by_torque and identification.disturbance is not None):
        return []
    return [paragraph("The residual is at the noise floor: nothing significant is unexplained.")]


def _residual_contents(identification: Identification) -> list[Markup]:
    """What the residual holds in words, before and after, so that one sees what went away."""
    found = {"declared model": identification.residual_before, "final model": identification.residual_after}
    return [
        _titled(f"What the residual contains: {name}", diagnosis_sentences(one, identification.axis))
        for name, one in found.items() if one is not None
    ]  # fmt: skip


def _candidates(identification: Identification) -> Markup:
    verdict = identification.verdict
    return section(
        "candidates",
        "Effects tried",
        candidate_table(verdict.candidates, identification.noise_floor.holdout_rate_rms),
        _titled("Follow-up", follow_up_lines(identification.follow_up) if identification.follow_up else ()),
    )


def _sets(identification: Identification, recording: Recording, gallery: Gallery) -> Markup:
    remarked = {one.name for one in identification.per_set if one.advice}
    determined = determined_table(compare_with_bound(identification, recording), remarked)
    if not identification.per_set and identification.joint is None:
        return section("sets", "What the data could determine", determined) if determined.html else determined
    return section(
        "sets",
        "Set by set",
        set_table(identification) if identification.per_set else Markup(""),
        folded("Cramer-Rao bound and standard error reached", determined) if determined.html else determined,
        *_genetic(identification, gallery),
    )


def _genetic(identification: Identification, gallery: Gallery) -> list[Markup]:
    """The search of the paper, folded away: the closed form gives the same numbers."""
    figure = convergence_figure(identification)
    if figure is None:
        return []
    return [folded("Genetic algorithm", gallery.place(figure), convergence_table(identification))]


def _response(identification: Identification, recording: Recording, gallery: Gallery) -> Markup:
    figure = response_figure(identification, recording)
    return Markup("") if figure is None else section("response", "Frequency response", gallery.place(figure))


def _motion(identification: Identification, gallery: Gallery) -> Markup:
    figures = [gallery.place(figure) for figure in motion_figures(identification)]
    total = len(identification.traces)
    note = (
        f"The {MAX_RUNS_DRAWN} of {total} runs with the largest error; recording.h5 has all."
        if total > MAX_RUNS_DRAWN
        else ""
    )
    hint = "Drag to zoom, double-click to see all, click a legend entry to hide or show it."
    return section("motion", "Measured and simulated", paragraph(f"{note} {hint}".strip(), class_="note"), *figures)
