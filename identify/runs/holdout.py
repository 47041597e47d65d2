"""Which samples fit and which judge, and a shorter selection for the many fits of a search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from identify.signals.trace import SHORTEST_STRETCH, Trace

BLOCKS, JUDGING = 10, (3, 6, 9)  # of a run that is split; which judge, where nobody says how many
FINE_BLOCKS = 20  # of a run of which a share that somebody asked for judges
PIECES = 2  # of each of five runs while searching, where a run has more usable spans; more of fewer runs
ENOUGH = 8_000  # samples that a search fits to; the final fit always takes all


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
        alone = "only start states, biases and the phase of disturbances are fitted there"
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
        "measure the errors. Start states are fitted there; the final parameters are refitted on all samples"
    )
    return Split(fit, judge, [t.keep.copy() for t in traces], note)


def _blocks(share: float | Literal["auto"]) -> tuple[int, tuple[int, ...]]:
    """In how many blocks a run is cut, and which of them, counted from one, judge: never the first, a run's start."""
    if share == "auto":
        return BLOCKS, JUDGING
    count = max(1, round(share * FINE_BLOCKS))
    return FINE_BLOCKS, tuple(1 + int((i + 0.5) * FINE_BLOCKS / count) for i in range(count))


def _held_out(blocks: Sequence[int]) -> str:
    if len(blocks) == 1:
        return f"block {blocks[0]} is"
    return f"blocks {', '.join(str(b) for b in blocks[:-1])} and {blocks[-1]} are"


def pieces(traces: Sequence[Trace], masks: Sequence[Any], shortest_s: float, enough: int = ENOUGH) -> list[Trace]:
    """Traces cut down to the samples of the masks, thinned to about ``enough`` samples.

    Each run keeps its first stretch, for the start transient, and equally spaced pieces behind it, each at
    least ``shortest_s`` long, so that the slowest motion of interest fits in.
    """
    total = sum(int(np.sum(m)) for m in masks)
    few = max(PIECES, round(PIECES * 5 / max(len(traces), 1)))
    out = []
    for trace, mask in zip(traces, masks, strict=True):
        spans = _runs_of(mask, trace.stretches)
        if total > enough and len(spans) > few:  # few long pieces: each start state costs two unknowns
            spans = [spans[i] for i in np.unique(np.linspace(0, len(spans) - 1, few).astype(int))]
        share = int(np.sum(mask)) if total <= enough else int(enough * np.sum(mask) / total)
        for k, (a, b) in enumerate(spans):
            length = b - a + 1
            wanted = length if total <= enough else max(
                round(share * length / max(int(np.sum(mask)), 1)), round(shortest_s / trace.step_s), SHORTEST_STRETCH
            )  # fmt: skip
            if k == 0 and total > enough:
                wanted *= 2
            if share <= 0 and k > 0:
                break
            last = min(b, a + wanted - 1)
            out.append(trace.piece(a, last))
    return [t for t in out if t.stretches]


def _runs_of(mask: Any, stretches: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Spans of samples that count, lost single samples bridged, no longer than a stretch."""
    out = []
    for a, b in stretches:
        index = np.nonzero(mask[a : b + 1])[0]
        if len(index) == 0:
            continue
        cuts = np.nonzero(np.diff(index) > SHORTEST_STRETCH)[0]
        begins = index[np.concatenate([[0], cuts + 1])]
        ends = index[np.concatenate([cuts, [len(index) - 1]])]
        out += [(a + int(i), a + int(k)) for i, k in zip(begins, ends, strict=True) if k - i + 1 >= SHORTEST_STRETCH]
    return out
