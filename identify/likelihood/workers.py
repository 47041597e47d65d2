"""Two threads: for the runs and parameters of one fit, or for two fits at once, which waits less."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor, wait
from threading import Event, local
from typing import TypeVar

_In = TypeVar("_In")
_Out = TypeVar("_Out")


class Workers:
    """The threads of one problem."""

    AT_ONCE = 2

    def __init__(self) -> None:
        self._parts, self._fits = ThreadPoolExecutor(self.AT_ONCE), ThreadPoolExecutor(self.AT_ONCE)
        self._thread, self._stopped = local(), Event()

    def map(self, work: Callable[[_In], _Out], items: Iterable[_In]) -> Iterable[_Out]:
        """Work on parts of one fit, in their order; one after the other where fits are side by side."""
        if not getattr(self._thread, "fits", False):
            return self._parts.map(work, items)
        if self._stopped.is_set():
            raise CancelledError
        return map(work, items)

    def side_by_side(self, fits: Sequence[Callable[[], _Out]]) -> list[_Out]:
        """Several fits, in their order."""
        if len(fits) < self.AT_ONCE or getattr(self._thread, "fits", False):
            return [fit() for fit in fits]

        def alone(fit: Callable[[], _Out]) -> _Out:
            self._thread.fits = True
            try:
                return fit()
            finally:
                self._thread.fits = False

        futures = [self._fits.submit(alone, fit) for fit in fits]
        try:
            return [future.result() for future in futures]
        except BaseException:  # Ctrl-C: fits that nobody waits for would hold the process up
            self._stopped.set()
            for future in futures:
                future.cancel()
            wait(futures)
            self._stopped.clear()
            raise
