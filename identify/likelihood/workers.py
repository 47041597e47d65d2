"""Work side by side: whole fits in two processes where the system can fork one, parts of a long fit in two threads.

Most of a fit on the samples of a search is Python between short compiled calls, which threads only take turns at. A
process that is forked has all of its parent's recording without a copy, works on its own, and sends back what it found.
"""

from __future__ import annotations

import io
import os
import pickle
import select
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, TypeVar

_In = TypeVar("_In")
_Out = TypeVar("_Out")
_Done = TypeVar("_Done")

FORKS = sys.platform == "linux"  # elsewhere a forked process may not use the system's libraries, or there is no fork
PATIENCE, SHORTEST_WAIT_S = 10.0, 30.0  # times what the parent's own share took, that it waits for the child's


class Workers:
    """What one problem works with.

    Parameters
    ----------
    shared
        Objects that results refer to: the very ones of the parent come back in what a child sends.
    threads
        Whether parts of a fit are long enough for threads.
    """

    AT_ONCE = 2

    def __init__(self, shared: Sequence[object] = (), threads: bool = True) -> None:
        self._shared = {id(x): x for x in shared}
        self._pool = ThreadPoolExecutor(self.AT_ONCE) if threads else None
        self._busy = False  # in a child, or beside one

    def map(self, work: Callable[[_In], _Out], items: Sequence[_In]) -> Iterable[_Out]:
        """Work on parts of one fit, in their order; one after the other where fits are side by side."""
        alone = self._busy or len(items) < self.AT_ONCE  # handing one over costs more than it brings
        return map(work, items) if alone or self._pool is None else self._pool.map(work, items)

    def each(self, work: Callable[[_In], _Out], items: Sequence[_In]) -> list[_Out]:
        """Work on many items that have nothing to do with each other, in their order."""
        return self.side_by_side([partial(work, x) for x in items])

    def side_by_side(self, tasks: Sequence[Callable[[], _Done]]) -> list[_Done]:
        """Several tasks that have nothing to do with each other, in their order.

        Whichever process is free takes the next: one task may take ten times as long as another.
        """
        if len(tasks) < self.AT_ONCE or self._busy or not FORKS or len(os.sched_getaffinity(0)) < self.AT_ONCE:
            return [task() for task in tasks]
        begun = time.monotonic()
        self._busy = True
        queue = _Queue(len(tasks))
        child = _Child(self, tasks, queue)
        try:
            out = {k: tasks[k]() for k in queue}
            own_s = time.monotonic() - begun
            # A child that failed has left its tasks undone: what stopped it is said here, where somebody hears it.
            out |= child.results(max(SHORTEST_WAIT_S, PATIENCE * own_s)) or {}
            return [out[k] if k in out else task() for k, task in enumerate(tasks)]
        finally:  # on Ctrl-C, too: what nobody waits for would go on
            child.end()
            queue.close()
            self._busy = False

    def packed(self, results: object) -> bytes:
        """Results as bytes, shared objects by what they are called here."""
        out = io.BytesIO()
        pickler = pickle.Pickler(out, pickle.HIGHEST_PROTOCOL)
        pickler.persistent_id = lambda x: id(x) if id(x) in self._shared else None  # type: ignore[method-assign]
        pickler.dump(results)
        return out.getvalue()

    def unpacked(self, sent: bytes) -> Any:
        """Results from bytes."""
        unpickler = pickle.Unpickler(io.BytesIO(sent))
        unpickler.persistent_load = self._shared.__getitem__  # type: ignore[method-assign]
        return unpickler.load()


class _Queue:
    """Numbers from zero, each handed out once, to whichever of several processes asks for it."""

    NUMBER_BYTES = 2  # a pipe hands out as many at once

    def __init__(self, count: int) -> None:
        self._next, writes = os.pipe()
        with os.fdopen(writes, "wb") as pipe:
            pipe.write(b"".join(k.to_bytes(self.NUMBER_BYTES, "little") for k in range(count)))

    def __iter__(self) -> Iterator[int]:
        while number := os.read(self._next, self.NUMBER_BYTES):
            yield int.from_bytes(number, "little")

    def close(self) -> None:
        """Hand out no more."""
        os.close(self._next)


class _Child:
    """A forked process that works on the tasks that it takes from a queue, and sends what it found."""

    def __init__(self, workers: Workers, tasks: Sequence[Callable[[], object]], queue: _Queue) -> None:
        self.workers = workers
        self.reads, writes = os.pipe()
        with warnings.catch_warnings():
            # Of threads beside a fork: those of this problem wait for work and hold nothing.
            warnings.simplefilter("ignore", DeprecationWarning)
            self.pid = os.fork()
        if self.pid:
            os.close(writes)
            return
        try:  # the child, which never leaves this block but by its end
            for name in (signal.SIGINT, signal.SIGHUP):
                signal.signal(name, signal.SIG_IGN)  # the parent hears it, and ends this process
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            os.close(self.reads)
            with os.fdopen(writes, "wb") as pipe:
                pipe.write(workers.packed({k: tasks[k]() for k in queue}))
        finally:
            os._exit(0)

    def results(self, patience_s: float) -> dict[int, Any] | None:
        """What the child found; None where it failed, or has not come to an end for so long."""
        parts, until = [], time.monotonic() + patience_s
        while select.select([self.reads], [], [], max(0.0, until - time.monotonic()))[0]:
            part = os.read(self.reads, 1 << 20)
            if not part:
                break
            parts.append(part)
        try:
            found: dict[int, Any] = self.workers.unpacked(b"".join(parts))
        except (EOFError, pickle.UnpicklingError):  # nothing came, or half of it
            return None
        return found

    def end(self) -> None:
        """End it, if it has not ended."""
        os.close(self.reads)
        os.kill(self.pid, signal.SIGKILL)  # until it is waited for its number is not given to another
        os.waitpid(self.pid, 0)
