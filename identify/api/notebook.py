"""A result as it shows in a notebook: verdict, parameters, what is left and errors, without scripts."""

from __future__ import annotations

from identify.conclude.next_steps import next_steps
from identify.report.page.markup import Markup, bullets, element, join, paragraph
from identify.report.page.plots.disturbance import disturbance_table
from identify.report.page.tables import error_table, parameter_table
from identify.results import Identification

# Of this output only: a notebook shows other tables, too.
STYLE = (
    ".isp-rig table{border-collapse:collapse;margin:6px 0}"
    ".isp-rig caption{caption-side:bottom;text-align:left;opacity:.7;font-size:85%}"
    ".isp-rig th,.isp-rig td{padding:2px 12px 2px 0;text-align:left}"
    ".isp-rig .number{text-align:right;font-variant-numeric:tabular-nums}"
)


def notebook_html(identification: Identification) -> str:
    """A fragment of HTML; whatever comes from outside is escaped."""
    if identification.aborted:
        state = "ABORTED: the search was interrupted"
    else:
        state = "ACCEPTED" if identification.accepted else "NOT ACCEPTED"
    steps = next_steps(identification)
    body = join(
        [
            paragraph(element("strong", state)),
            *[paragraph(sentence) for sentence in identification.verdict.sentences],
            bullets(identification.reasons),
            *([paragraph(element("strong", "What to run next")), bullets(steps)] if steps else []),
            parameter_table(identification),
            disturbance_table(identification),
            error_table(identification),
        ]
    )
    return element("div", Markup(f"<style>{STYLE}</style>"), body, class_="isp-rig").html
