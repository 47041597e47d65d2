"""Which samples fit and which judge, and a shorter selection for the many fits of a search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from identify.signals.trace import Trace

HOLDOUT_BLOCKS, JUDGING = 10, (3, 6, 9)  # of a run that is split; which judge, where nobody says how many
FINE_BLOCKS = 20  # of a run of which a share that somebody asked for judges


@dataclass(frozen=True)
class Split:
    """Boolean arrays, one a run: what fits while searching, what judges, what the final fit may use."""

    fit: list[Any]
    judge: list[Any]
    final: list[Any]
    note: str

    @property
    def everything(self) -> list[Any]:
        """All samples that are looked at, held out or not."""
        return [f | j for f, j in zip(self.final, self.judge, strict=True)]


def split(traces: Sequence[Trace], share: float | Literal["auto"] = "auto") -> Split:
    """Declared hold-out runs judge where there are any; else every third block of each run, or a share of blocks."""
    declared = [t.run.use == "holdout" for t in traces]
    if any(declared) and not all(declared):
        names = ", ".join(dict.fromkeys(t.run.name for t, d in zip(traces, declared, strict=True) if d))
        keep = [t.keep.copy() for t in traces]
        none = [np.zeros(len(k), dtype=bool) for k in keep]
        fit = [n if d else k for k, n, d in zip(keep, none, declared, strict=True)]
        judge = [k if d else n for k, n, d in zip(keep, none, declared, strict=True)]
        alone = "there only the state at the beginning, biases and the phase of disturbances are fitted"
        return Split(fit, judge, fit, f"Held out as declared: {names}; {alone}")
    fit, judge = [], []
    some_free = any(t.run.use == "auto" for t in traces)
    blocks, chosen = _blocks(share)
    for trace in traces:
        if some_free and trace.run.use == "fit":
            fit.append(trace.keep.copy())
            judge.append(np.zeros(len(trace.keep), dtype=bool))
            continue
        block = 1 + np.minimum(np.arange(len(trace.keep)) * blocks // len(trace.keep), blocks - 1)
        judging = np.isin(block, chosen)
        fit.append(trace.keep & ~judging)
        judge.append(trace.keep & judging)
    who = "" if share == "auto" else f" (identify.holdout: {share:g})"
    note = (
        f"Each run is split into {blocks} blocks; {_held_out(chosen)} held out{who} to compare candidates and to "
        "measure the errors. In the held-out blocks only the state at the beginning is fitted; the final parameters "
        "use all samples"
    )
    return Split(fit, judge, [t.keep.copy() for t in traces], note)


def _blocks(share: float | Literal["auto"]) -> tuple[int, tuple[int, ...]]:
    """In how many blocks a run is cut, and which of them, counted from one, judge: never the first, a run's start."""
    if share == "auto":
        return HOLDOUT_BLOCKS, JUDGING
    count = max(1, round(share * FINE_BLOCKS))
    return FINE_BLOCKS, tuple(1 + int((i + 0.5) * FINE_BLOCKS / count) for i in range(count))


def _held_out(blocks: Sequence[int]) -> str:
    if len(blocks) == 1:
        return f"block {blocks[0]} is"
    return f"blocks {', '.join(str(b) for b in blocks[:-1])} and {blocks[-1]} are"
