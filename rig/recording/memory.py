"""A memory limit around a library that trusts the sizes stated in a file."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def at_most(more_bytes: int) -> Iterator[None]:
    """Within this, an allocation that takes the process so far beyond what it has now fails, as MemoryError or as the
    library's own error. Linux only: other systems have no limit that holds, and there it does nothing.
    """
    if sys.platform != "linux":
        yield
        return
    import resource  # noqa: PLC0415  POSIX only

    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    wanted = pages * resource.getpagesize() + more_bytes
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    tighter = wanted if soft == resource.RLIM_INFINITY else min(wanted, soft)
    resource.setrlimit(resource.RLIMIT_AS, (tighter, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
