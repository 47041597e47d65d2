"""Workers: processes of this machine, or those of a Dask scheduler."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from commands.identify_batch.campaign import ProcessEnded, identify_campaign
from commands.identify_batch.campaigns import Job
from commands.identify_batch.dispatch import Done, NotRun, Outcome, WorkerDied
from commands.terminal.version import version
from rig.errors import Aborted, MissingPackage, UsageError

if TYPE_CHECKING:
    from distributed import Client, Future

INSTALL = "pip install 'isp-rig[batch]'"
CONNECT_S = 10.0  # until a scheduler that does not answer is given up
MAX_WORKER_START_S = 120.0  # in which a local worker comes back after a kill, on a busy machine
# One thread each: small matrices gain nothing from a second, and the processes fill the cores.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
SET_UP = "commands.identify_batch.worker_process"


def require_batch() -> None:
    """Raise MissingPackage, with the line that installs them, where Dask, pyarrow or cryptography are missing."""
    for name in ("distributed", "pyarrow", "cryptography"):
        try:
            __import__(name)
        except ImportError:
            raise MissingPackage(
                f"identify-batch needs the package {name}, which is not installed: {INSTALL}"
            ) from None


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class DaskPool:
    """The workers of a Dask cluster.

    Parameters
    ----------
    most
        Campaigns at once, or None for as many as the workers have threads.
    """

    def __init__(self, client: Client, where: str, most: int | None, say: Callable[[str], None]) -> None:
        self._client, self._where, self._most, self._say = client, where, most, say
        self._away_since: float | None = None

    def capacity(self) -> int:
        """Campaigns that can run at once."""
        if self._most is not None:
            return self._most
        return self._threads()

    def _threads(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except OSError:  # the scheduler does not answer; `check` decides when that is the end
            return 0

    def submit(self, job: Job, done: Done) -> Callable[[], Outcome]:
        """Start a campaign; each attempt is a task of its own."""
        future = self._client.submit(identify_campaign, job, key=f"identify-{uuid4().hex}", pure=False)
        future.add_done_callback(lambda _: done())
        return lambda: _outcome(future)

    def check(self) -> None:
        """Raise Aborted where the scheduler is lost, or where no worker of this machine comes up."""
        if self._client.status == "closed":
            raise Aborted(f"the scheduler at {self._where} no longer answers: start it and run the same command again.")
        if self._threads():
            self._away_since = None
        elif self._away_since is None:
            self._away_since = time.monotonic()
            self._say(f"waiting for workers at {self._where}")
        elif self._most is not None and time.monotonic() - self._away_since > MAX_WORKER_START_S:
            raise Aborted(f"no worker process has started within {MAX_WORKER_START_S:g} s: use fewer --workers.")


def _outcome(future: Future) -> Outcome:
    from distributed import KilledWorker

    if future.status == "finished":
        row: Outcome = future.result()
        return row
    if future.status == "error":
        error = future.exception()
        if isinstance(error, KilledWorker):
            return WorkerDied("its process was killed")
        if isinstance(error, ProcessEnded):
            return WorkerDied(str(error))
        return NotRun(f"the worker could not run it: {type(error).__name__}: {error}")
    return WorkerDied(f"the scheduler cancelled it ({future.status})")


@contextlib.contextmanager
def local_workers(count: int, say: Callable[[str], None]) -> Iterator[DaskPool]:
    """``count`` processes of this machine, on a scheduler in this process that only they are let in to."""
    import dask
    from distributed import Client, LocalCluster
    from distributed.security import Security

    settings = {
        "distributed.scheduler.allowed-failures": 0,  # who is run again, and when, is decided here
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.worker.daemon": True,
    }
    with dask.config.set(settings):
        options: dict[str, Any] = {
            "n_workers": count, "threads_per_worker": 1, "processes": True, "dashboard_address": None,
            "silence_logs": logging.CRITICAL, "memory_limit": 0, "security": Security.temporary(),
            "host": "127.0.0.1", "env": ONE_THREAD, "preload": [SET_UP],
        }  # fmt: skip
        with (
            _loop_without_signals() as loop,
            LocalCluster(loop=loop, **options) as cluster,
            Client(cluster, set_as_default=False) as client,
        ):
            yield DaskPool(client, "this machine", count, say)


@contextlib.contextmanager
def _loop_without_signals() -> Iterator[Any]:
    """A loop in a thread that blocks Ctrl-C; processes that it starts inherit that, so that it ends the client alone.

    On Windows the workers ignore it themselves, from a moment after they have been started.
    """
    from distributed.utils import LoopRunner

    runner = LoopRunner(asynchronous=False)
    blocked = [getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name)]
    has_masks = hasattr(signal, "pthread_sigmask")
    if has_masks:
        from multiprocessing import resource_tracker

        resource_tracker.ensure_running()  # when it is started it unblocks Ctrl-C in the thread that starts it
    before = signal.pthread_sigmask(signal.SIG_BLOCK, blocked) if has_masks else None
    try:
        runner.start()
    finally:
        if before is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        yield runner.loop
    finally:
        runner.stop()


@contextlib.contextmanager
def scheduler_workers(address: str, say: Callable[[str], None]) -> Iterator[DaskPool]:
    """The workers of the scheduler at ``address``; of whatever program that runs, they have to have this version.

    Raises UsageError where nothing answers there, or where a worker has another version.
    """
    from distributed import Client

    for name in [n for n in logging.root.manager.loggerDict if n.partition(".")[0] == "distributed"]:
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters of it is said in words of our own
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        text = " ".join(str(error).split())[:200]
        raise UsageError(
            f"--scheduler {address}: no Dask scheduler answers there within {CONNECT_S:g} s ({text}): start one with "
            "`dask scheduler`, or leave --scheduler out for workers on this machine"
        ) from None
    with client:
        _require_this_version(client, address)
        yield DaskPool(client, address, None, say)


def _require_this_version(client: Client, address: str) -> None:
    own = version()
    try:
        found = client.run(version)
    except Exception as error:  # noqa: BLE001 (whatever a worker without this package makes of it)
        raise UsageError(
            f"--scheduler {address}: a worker there cannot run isp-rig ({type(error).__name__}: {error}): install "
            f"version {own} in its environment: {INSTALL}"
        ) from None
    for worker, theirs in found.items():
        if theirs != own:
            raise UsageError(
                f"--scheduler {address}: the worker {worker} has isp-rig {theirs}, this is {own}: install {own}"
            )
