"""Which names have a rival that more data could exclude, and the models of both as the finished model has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.bounds.cramer_rao import vector_of
from identify.estimate.evaluation import evaluate
from identify.estimate.output_error import OutputErrorFit, refine
from identify.follow_up.separation import Imitation, prior_of
from identify.results import Identification, Unparted
from identify.signals.trace import Trace
from rig import effects
from rig.platform import TERMS, Platform

MAX_PAIRS = 4  # of an effect and a rival, that are planned for at once
EXCLUDED = 25.0  # chi square by which the data have excluded a rival already
REFIT = 10  # iterations in which a rival is fitted into the finished model


@dataclass(frozen=True)
class Pair:
    """An effect and its rival, each in the finished model, and the directions in which data have to decide."""

    effect: str
    rival: str
    models: tuple[Platform, Platform]
    imitations: tuple[Imitation, ...]


def never_reason(effect: str, rival: str, travel_deg: float) -> str:
    """Why no excitation within the allowed travel can tell two effects apart; empty where some can."""
    read = [c.name for c in (effects.get(effect).reads, effects.get(rival).reads) if c is not None]
    if read:
        return f"{' and '.join(read)} cannot be varied by the torque: record a run in which it varies on its own"
    return effects.get(effect).alike(rival, travel_deg) or effects.get(rival).alike(effect, travel_deg)


def pairs_of(
    found: Identification, traces: Sequence[Trace], noise: float, travel_deg: float
) -> tuple[list[Pair], list[Unparted]]:
    """The pairs to part, and those for which nothing can be planned within a travel."""
    pairs: list[Pair] = []
    without: list[Unparted] = []
    final = found.final.platform
    for effect, rivals in found.verdict.confusable_with.items():
        for rival in rivals:
            why = never_reason(effect, rival, travel_deg)
            model = found.verdict.rival_models.get(effect, {}).get(rival)
            if why:
                without.append(Unparted(effect, rival, why))
            elif final is None or model is None or effect not in final.effects:
                without.append(Unparted(effect, rival, "no fitted model of the alternative is available for planning"))
            elif len(pairs) == MAX_PAIRS:
                without.append(
                    Unparted(effect, rival, f"at most {MAX_PAIRS} pairs are planned at once; the others come first")
                )
            else:
                placed = _in_place(final, effect, rival, model, traces, noise)
                if placed is None:
                    why = "with the final model, the present data already exclude the alternative"
                    without.append(Unparted(effect, rival, why))
                else:
                    pairs.append(
                        Pair(effect, rival, (final, placed), _imitations(final, placed, effect, rival, traces, noise))
                    )
    return pairs, without


def _imitations(
    named: Platform, other: Platform, effect: str, rival: str, traces: Sequence[Trace], noise: float
) -> tuple[Imitation, ...]:
    """Where both have as many parameters either may be the truth, and the other has to fail.

    One with more parameters may pass for the simpler without being true: that is for their penalty to decide. So
    the data have to show only that the simpler cannot pass for the richer.
    """
    sizes = len(effects.get(effect).parameters), len(effects.get(rival).parameters)
    out = []
    if sizes[0] <= sizes[1]:
        out.append(Imitation(other, named, prior_of(named, traces, noise)))
    if sizes[1] <= sizes[0]:
        out.append(Imitation(named, other, prior_of(other, traces, noise)))
    return tuple(out)


def _in_place(
    final: Platform, effect: str, rival: str, model: Platform, traces: Sequence[Trace], noise: float
) -> Platform | None:
    """The rival in the place of the effect in the finished model; None where the data exclude it there."""
    wanted = tuple(rival if e == effect else e for e in final.effects)
    if set(model.effects) == set(wanted):
        return model
    terms = tuple(t for t in TERMS if t in (*final.terms, *model.terms))
    held = {e: model.effects[rival] if e == rival else final.effects[e] for e in wanted}
    swapped = replace(final, effects=held, terms=terms)
    structure, names, values = vector_of(swapped, 1 + max(t.number for t in traces))
    start = dict(zip(names, values.tolist(), strict=True))
    fitted = refine(traces, structure, start, None, REFIT, coarse=True, tolerance=1e-3)
    if not np.isfinite(fitted.sigma):
        return None
    worse = (fitted.sigma**2 - _sigma(final, traces) ** 2) * fitted.count / noise**2
    return None if worse > EXCLUDED else fitted.platform()


def _sigma(platform: Platform, traces: Sequence[Trace]) -> float:
    """Root mean square that a platform leaves of recorded runs in free run."""
    return free_run(platform, traces).sigma


def free_run(platform: Platform, traces: Sequence[Trace]) -> OutputErrorFit:
    """A platform in free run over recorded runs: start states and bias fitted, and what belongs to single runs."""
    structure, names, values = vector_of(platform, 1 + max(t.number for t in traces))
    shared = [i for i, n in enumerate(names) if len(n) < 3]
    names, values = tuple(names[i] for i in shared), values[shared]
    return evaluate(OutputErrorFit.unfitted(structure, names, values), traces)
