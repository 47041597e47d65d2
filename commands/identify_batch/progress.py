"""How far a batch is: campaigns done, failed, and the time that the rest will take."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from commands.identify_batch.row import FAILED, Row

if TYPE_CHECKING:
    from commands.terminal.display import Terminal

MINUTE_S, HOUR_S = 60.0, 3600.0


class Progress:
    """Counts rows and says so, a line a campaign; on a terminal in one line that is written over.

    Parameters
    ----------
    total, done, failed
        Campaigns in all, and of them those that stood in the journal already.
    now
        Seconds on a clock that only goes forward.
    """

    def __init__(
        self, terminal: Terminal, total: int, done: int, failed: int, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._terminal, self._total, self._now = terminal, total, now
        self.done, self.failed = done, failed
        self._earlier, self._began = done, now()

    def finished(self, row: Row) -> None:
        """One more row is kept."""
        from commands.terminal.display import plain

        self.done += 1
        if row["status"] == FAILED:
            self.failed += 1
            self._terminal.show_always(f"failed: {plain(row['path'])}: {plain(' '.join(str(row['reason']).split()))}")
        ahead = "" if self._terminal.has_bars else f"{plain(row['path'])}, {row['seconds']:.1f} s: "
        self._terminal.note(f"{ahead}{self.stand()}")

    def stand(self) -> str:
        """ "12/40 done, 1 failed, about 3 min left"."""
        left, here = self._total - self.done, self.done - self._earlier
        expected = f", about {duration((self._now() - self._began) / here * left)} left" if left and here else ""
        return f"{self.done}/{self._total} done, {self.failed} failed{expected}"


def duration(seconds: float) -> str:
    """ "40 s", "12 min", "3 h 20 min"."""
    if seconds < 2 * MINUTE_S:
        return f"{seconds:.0f} s"
    if seconds < 2 * HOUR_S:
        return f"{seconds / MINUTE_S:.0f} min"
    return f"{seconds // HOUR_S:.0f} h {seconds % HOUR_S / MINUTE_S:.0f} min"
