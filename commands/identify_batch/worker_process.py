"""Sets up a worker process of this machine: Ctrl-C is for the client, which ends its workers itself."""

from __future__ import annotations

import signal

from commands.terminal.exit_codes import hide_library_warnings


def dask_setup(worker: object) -> None:
    """Called by Dask in every worker process before it takes a campaign."""
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    hide_library_warnings()
