"""Faults requested live: JSON lines on a descriptor, read without waiting."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable

from pydantic import ValidationError

from rig.config.bench import InjectedFault
from rig.errors import ConfigError

EVERY_S = 0.01  # between two looks
MAX_REQUEST_BYTES = 65_536  # bytes of a request


class FaultRequests:
    """Takes lines like ``{"fault": "gyro_silent", "lasts_s": 0.2}`` and hands them on.

    Parameters
    ----------
    descriptor
        Where the lines come from; its end is no error.
    inject
        Takes a fault, or raises ConfigError.
    refuse
        Told why a line was no fault.
    """

    def __init__(
        self,
        descriptor: int,
        inject: Callable[[InjectedFault], None],
        refuse: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._descriptor: int | None = descriptor
        self._inject, self._refuse, self._clock = inject, refuse, clock
        self._rest = b""
        self._due_s = 0.0

    def poll(self) -> None:
        """Take what has come, at most a hundred times a second."""
        now_s = self._clock()
        if self._descriptor is None or now_s < self._due_s:
            return
        self._due_s = now_s + EVERY_S
        try:
            if not select.select([self._descriptor], [], [], 0)[0]:
                return
            data = os.read(self._descriptor, MAX_REQUEST_BYTES)
        except (OSError, ValueError):
            data = b""
        if not data:
            self._descriptor = None
            return
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_REQUEST_BYTES:
            self._rest = b""
            self._refuse("a line without an end")
        for line in lines:
            if line.strip():
                self._take(line)

    def _take(self, line: bytes) -> None:
        try:
            self._inject(InjectedFault.model_validate_json(line))
        except ConfigError as problem:
            self._refuse(str(problem))
        except ValidationError as problem:
            first = problem.errors(include_url=False)[0]
            where = ".".join(map(str, first["loc"])) or "the line"
            self._refuse(f"{where}: {first['msg']}")
