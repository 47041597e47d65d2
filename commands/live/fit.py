"""J, C and K from the sets that are complete so far: a first fit, to see the numbers settle while it plays."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from commands.live.state import PlayedSet
from rig.recording.journal_reader import JournalRun, run_from_journal

NICE = 19
SYMBOLS = {"inertia": "J", "damping": "C", "stiffness": "K"}
UNITS = {"inertia": "kg·m²", "damping": "N·m·s/rad", "stiffness": "N·m/rad"}


def fit_worker(connection: Connection) -> None:
    """Answer every (complete sets, terms) with its fit, None where they do not suffice, until the other end closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the campaign
    _step_back()
    _load()
    with contextlib.suppress(EOFError, OSError):
        while True:
            complete, terms = connection.recv()
            try:
                row = fit_of(complete, terms)
            except Exception:  # noqa: BLE001 (whatever the sets lack, the page goes on without a row)
                row = None
            connection.send(row)


def _step_back() -> None:
    """Run only where nobody else wants to: the loop waits for emulated devices, which have no priority of their own."""
    if hasattr(os, "SCHED_IDLE"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    if hasattr(os, "nice"):
        os.nice(NICE)


def _load() -> None:
    """What a fit needs takes seconds of a processor: loaded before torque is on, not after the first set."""
    import identify.estimate.final_fit
    import identify.estimate.initial_guess
    import identify.signals.prepare  # noqa: F401


def fit_of(complete: Sequence[PlayedSet], terms: Sequence[str]) -> Mapping[str, Any]:
    """Value and half the 95 % interval of every declared term, by regression; no effect is looked for.

    Raises what the identification raises where the sets do not suffice.
    """
    from threadpoolctl import threadpool_limits

    from identify.estimate.final_fit import by_regression
    from identify.estimate.initial_guess import first_guess
    from identify.model.structure import Structure
    from identify.results import ParameterEstimate
    from identify.signals.prepare import prepare
    from identify.wording import half_of, value_of

    runs = [run_from_journal(_as_journal_run(one)) for one in complete]
    structure = Structure(tuple(terms))
    with threadpool_limits(1):
        traces = [prepare(run, i, None) for i, run in enumerate(runs)]
        use = [t.keep for t in traces]
        found = by_regression(traces, structure, {}, first_guess(traces, structure), use, use, {})
    rows = {}
    for term in terms:
        shown = ParameterEstimate.normal(found.values[term,], found.std_error((term,)), UNITS[term])
        rows[term] = {
            "symbol": SYMBOLS[term], "unit": UNITS[term], "value": value_of(shown),
            "half": half_of(shown) if np.isfinite(shown.std_error) else "-",
        }  # fmt: skip
    return {"sets": len(complete), "name": complete[-1].name, "terms": rows}


def _as_journal_run(one: PlayedSet) -> JournalRun:
    columns = {kind: tuple(names) for kind, names in one.columns.items()}
    tables = {
        kind: np.concatenate(one.tables[kind]) if one.tables.get(kind) else np.empty((0, len(names)))
        for kind, names in columns.items()
    }
    return JournalRun(one.name, one.meta, columns, tables, ended=True, complete=True)
