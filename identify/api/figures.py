"""The report's figures for Python: which there are, and what to say where one has nothing to show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from identify.api.matplotlib_figure import drawn
from identify.report.page.plots.convergence import convergence_figure
from identify.report.page.plots.disturbance import shape_figure
from identify.report.page.plots.estimates import estimates_figure
from identify.report.page.plots.figure import Figure
from identify.report.page.plots.motion import run_figure
from identify.report.page.plots.residual import residual_figures
from identify.report.page.plots.response import response_figure
from identify.report.page.plots.spectrum import spectrum_figures
from identify.results import Identification
from rig.errors import InputError
from rig.recording.run import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

RESIDUALS = ("time", "angle", "direction", "rate")  # in the report's order
NOT_SIMULATED = "no run was simulated, so there is nothing to draw: read .reasons"


def motion(identification: Identification, run: int | str) -> MatplotlibFigure:
    """One run by number or name."""
    traces = identification.traces
    names = [trace.name for trace in traces]
    if isinstance(run, str) and run in names:
        run = names.index(run)
    if isinstance(run, bool) or not isinstance(run, int) or not -len(traces) <= run < len(traces):
        listed = ", ".join(f"{i} ({name!r})" for i, name in enumerate(names[:20])) or "none"
        raise InputError(f"run is {run!r:.60}, which is not among the runs that were used: {listed}")
    return drawn(run_figure(identification, traces[run]))


def residual(identification: Identification, against: str) -> MatplotlibFigure:
    """What is left, against one of ``RESIDUALS``."""
    if against not in RESIDUALS:
        raise InputError(f"against is {against!r:.60}: choose one of {', '.join(map(repr, RESIDUALS))}")
    several = residual_figures(identification)
    return drawn(_known(several[RESIDUALS.index(against)] if several else None, NOT_SIMULATED))


def spectrum(identification: Identification) -> MatplotlibFigure:
    """What is left, against frequency."""
    return drawn(_known(_first(spectrum_figures(identification)), NOT_SIMULATED))


def response(identification: Identification, recording: Recording) -> MatplotlibFigure:
    """The frequency response."""
    why = "no frequency response can be estimated: it needs a torque, and runs of several periods"
    return drawn(_known(response_figure(identification, recording), why))


def parameters(identification: Identification) -> MatplotlibFigure:
    """Every parameter from every run."""
    return drawn(_known(estimates_figure(identification), "no parameter is determined: read .reasons"))


def disturbance(identification: Identification) -> MatplotlibFigure:
    """The shape of what is left."""
    why = "the residual depends on no quantity that was tested, so there is no shape to draw: see .disturbance"
    return drawn(_known(shape_figure(identification), why))


def convergence(identification: Identification) -> MatplotlibFigure:
    """The genetic algorithm's objective."""
    return drawn(_known(convergence_figure(identification), "the genetic algorithm did not run on these data"))


def _first(several: Sequence[Figure]) -> Figure | None:
    return several[0] if several else None


def _known(figure: Figure | None, why: str) -> Figure:
    if figure is None:
        raise InputError(why)
    return figure
