"""After the last tick: the corrected time stamps of the rig, written to the journal."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping

from rig.errors import RigError
from rig.interface import Rig
from rig.recording.journal import Journal
from rig.recording.retiming import Retiming, event_values, retiming_of


def log_time_corrections(rig: Rig, journal: Journal | None, now_s: Callable[[], float]) -> Mapping[float, Retiming]:
    """Of every set that has them, by the instant at which it began; one event each in the journal.

    Never raises: torque is off, and what was recorded is good without.
    """
    try:
        found = {one.start_s: retiming_of(*one) for one in rig.corrections()}
    except Exception as error:  # noqa: BLE001 (nothing that goes wrong here may cost a recording)
        _log_event(journal, now_s, f"the times of the samples could not be corrected: {error!r}", {})
        return {}
    for start_s, better in found.items():
        values = event_values(start_s, better)
        if not _log_event(journal, now_s, "corrected times of a set", values):
            return {}
    return found


def _log_event(journal: Journal | None, now_s: Callable[[], float], text: str, values: Mapping[str, object]) -> bool:
    """False where the journal takes no more."""
    if journal is not None:
        with contextlib.suppress(RigError):
            journal.event(now_s(), text, values)
            return True
    return journal is None
