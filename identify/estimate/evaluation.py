"""A fitted model on samples that did not fit it: only what belongs to a run is found there, its start states and bias.

Gains that an effect has in every run anew (a disturbance's phase) are of that kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from identify.estimate.output_error import OutputErrorFit, refine
from identify.model.parameters import Name, equations_of, names_of
from identify.model.structure import Structure
from identify.signals.trace import Trace, pooled_noise
from identify.simulate.all_runs import shots_for
from identify.simulate.sensitivities import linearise
from identify.simulate.shots import RUNAWAY, Shots, losses_of, moved, predict
from rig.recording.run import Array

START_STATE_ROUNDS = 6  # rounds in which start states are fitted at fixed parameters
OWN_STEPS = 6  # in which the gains that a run has of its own are fitted at fixed parameters


def evaluate(
    fit: OutputErrorFit,
    traces: Sequence[Trace],
    use: Sequence[Any] | None = None,
    shot_s: float | None = None,
    coarse: bool = False,
    finer: int = 1,
    own_gains: bool = True,
) -> OutputErrorFit:
    """The same parameters on other samples: start states and biases are fitted there, and what a run has of its own.

    ``own_gains`` False takes gains that no fit knows for nothing, which a tone pays for that fits one run alone.
    """
    if own_gains:
        fit = _with_own_gains(fit, traces, use, shot_s, coarse, finer)
    names, x, structure = fit.names, fit.vector, fit.structure
    shots = shots_for(traces, structure, names, x, shot_s, use, None, coarse, finer)
    with ThreadPoolExecutor(2) as workers:
        fitted = list(workers.map(lambda s: settled(s, structure, names, x), shots))
    squares = sum(float(np.sum(losses)) for _, losses in fitted)
    count = sum(int(np.sum(s.weight)) for s, _ in fitted)
    looked_at = replace(fit, information=np.zeros((len(x),) * 2), shots=tuple(s for s, _ in fitted))
    return looked_at.with_residual(squares, count, pooled_noise(traces))


def _with_own_gains(
    fit: OutputErrorFit, traces: Sequence[Trace], use: Sequence[Any] | None, shot_s: float | None, coarse: bool,
    finer: int,
) -> OutputErrorFit:  # fmt: skip
    """The same, with the gains that runs have of their own (a disturbance's phase) fitted where no fit knew them.

    A run that was held out has them as it has a start state: a model without them would be judged by its luck.
    """
    structure = fit.structure
    values = dict(fit.values)
    runs = {str(t.number) for t in traces}
    unknown = runs - {n[2] for n, v in values.items() if len(n) == 3 and v != 0.0}
    names = names_of(structure, 1 + max(t.number for t in traces))
    own = [n for n in names if len(n) == 3 and n[2] in unknown]
    if not own:
        return fit
    asked = [i for i, t in enumerate(traces) if str(t.number) in unknown]
    fixed = [n for n in names if n not in own]
    few = None if use is None else [use[i] for i in asked]
    fitted = refine(
        [traces[i] for i in asked], structure, values, shot_s, OWN_STEPS, few, fixed=fixed, coarse=coarse, finer=finer
    )  # fmt: skip
    values |= {n: v for n, v in fitted.values.items() if n in own}
    return replace(fit, names=tuple(values), vector=np.array(list(values.values())))


@RUNAWAY
def settled(shots: Shots, structure: Structure, names: Sequence[Name], x: Array) -> tuple[Shots, Array]:
    """Start states and bias of one run at fixed parameters; every shot keeps what is best for itself."""
    still = np.ones(len(x), dtype=bool)
    equations = equations_of(structure, names, x, shots.number, shots.added)
    losses = losses_of(shots, shots.trace.measured - predict(shots, equations, shots.starts, shots.bias))
    share = np.ones(len(shots.first))  # of the full step that each shot dares
    for _ in range(START_STATE_ROUNDS):
        part = linearise(shots, structure, names, x, np.ones(len(x)), still, np.inf)
        step, bias = part.back(np.zeros(len(x)))
        trial = moved(shots, (step * share[:, None], bias))
        new = losses_of(trial, trial.trace.measured - predict(trial, equations, trial.starts, trial.bias))
        worse = ~(new <= losses)
        stuck = bool(np.all(worse)) or np.sum(np.where(worse, losses, new)) > np.sum(losses) * (1.0 - 1e-4)
        if stuck and (np.min(share) < 0.2 or not np.any(worse)):
            break
        share = np.where(worse, 0.3 * share, np.minimum(1.0, 2.0 * share))
        trial.starts[worse] = shots.starts[worse]
        kept = losses_of(trial, trial.trace.measured - predict(trial, equations, trial.starts, trial.bias))
        if np.sum(kept) > np.sum(losses):
            trial.bias = shots.bias
            kept = losses_of(trial, trial.trace.measured - predict(trial, equations, trial.starts, trial.bias))
        shots, losses = trial, kept
    return shots, losses
