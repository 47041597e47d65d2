"""`rig emulate`: the devices of a bench, emulated at wire level until Ctrl-C."""

from __future__ import annotations

import sys

from commands.campaign.backends import require_emulators
from commands.campaign.context import Options


def emulate_devices(options: Options) -> int:
    """Emulate until a signal ends it; faults are requested as JSON lines on standard input. Returns the exit code."""
    require_emulators()
    from sim_backend.emulators.process import run_emulators

    requests = sys.stdin.fileno() if sys.stdin is not None and not sys.stdin.closed else None
    run_emulators(options.load().config, requests)
    return 0
