"""The search on runs without torque: a decay is judged by how it swings on alone, over short spans and whole runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import numpy as np

from identify.estimate.cross_validation import horizon_s
from identify.estimate.initial_guess import Start
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import Split, pieces, split
from identify.select import decay_search
from identify.select.candidates import Candidates
from identify.select.free_run_search import FineSearch
from identify.select.search_state import Search
from identify.select.short_horizon_search import Loop
from identify.signals.prepare import one_noise, prepare
from identify.signals.trace import Trace
from rig.platform import Platform

PERIODS = 3.0  # horizons in a piece
JUDGED = 5_000  # samples that judge


class FreeDecay:
    """The search over structures on free decays.

    Parameters
    ----------
    traces, parts
        The runs, and which of their samples fit and judge.
    noise_known
        Whether the sensor's noise was given.
    holdout
        Share of the samples that is held out.
    """

    def __init__(
        self, traces: Sequence[Trace], parts: Split, start: Start, allowed: Sequence[str], structure: Structure,
        noise_known: bool, holdout: float | Literal["auto"], say: Callable[[str], None],
    ) -> None:  # fmt: skip
        traces, parts = _thinned(list(traces), parts, start, noise_known, holdout)
        horizon = horizon_s(start.platform, traces)
        fitting = pieces(traces, parts.fit, PERIODS * horizon)
        judging = pieces(traces, parts.judge, PERIODS * horizon, JUDGED)
        self.structure, self.say = structure, say
        self.loop = Loop(fitting, judging, start, allowed, say, traces)
        self.on_offer = Candidates(traces, parts, allowed, structure.effects)

    @property
    def so_far(self) -> Search | None:
        """What was found when somebody stops it."""
        return self.loop.so_far

    def run(
        self, shapes: Mapping[str, tuple[float, ...]], declared: Platform, values: Mapping[Name, float]
    ) -> Search:  # fmt: skip
        """From the declared structure to the one that the data support; ``values`` are the declared ones."""
        nominal = (declared.inertia_kg_m2, declared.damping_nm_s_rad, declared.stiffness_nm_rad)
        fine = FineSearch(self.on_offer, self.say, values)

        def take_over(found: Search) -> bool:
            over = decay_search.take_over(self.on_offer, found, self.say)
            if over and found.best.sigma > decay_search.STILL_COARSE * self.on_offer.fits.noise:
                return True  # whole runs have had their say, and the noise is not what is left
            return fine.take_over(found) or over

        search = self.loop.run(self.structure, shapes, nominal, take_over)
        had = search.best.structure.effects
        search.drop_a_bad_lot()
        if search.best.structure.effects != had:
            self.say(f"rejected: {', '.join(had)}; together they still leave too much unexplained")
        return search


def _thinned(
    traces: list[Trace], parts: Split, start: Start, noise_known: bool, holdout: float | Literal["auto"]
) -> tuple[list[Trace], Split]:  # fmt: skip
    """What the search looks at: of a slow decay that was sampled fast only every so manyth sample."""
    runs = [t.run for t in traces]
    j, _, k = start.platform
    few = decay_search.thinned(runs, float(np.sqrt(max(k / j, 0.0)) / (2.0 * np.pi)))
    if all(a is b for a, b in zip(few, runs, strict=True)):
        return traces, parts
    noise = traces[0].noise if noise_known else None
    prepared = [prepare(r, t.number, noise) for r, t in zip(few, traces, strict=True)]
    thin = one_noise(prepared, noise_known)
    return thin, split(thin, holdout)
