"""The file that `rig init` writes: one that exists is refused, with a name that is free and what to type next."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import count
from pathlib import Path

from rig.errors import UsageError

MAX_PROPOSED_LETTERS = 60  # of a recording's name in the proposed one
PACKED = ".gz"  # run.csv.gz is proposed as run.yaml


def exists_already(out: Path, sources: Sequence[Path]) -> UsageError:
    """The refusal of ``out``; ``sources`` are the recordings that were named, none for a bench."""
    free = str(free_name(out, sources))
    free = f'"{free}"' if re.search(r"\s", free) else free  # of the folder's name: the file's has none
    return UsageError(
        f"{out} exists and is never overwritten: repeat the command with --out {free}, then identify-run {free}"
    )


def free_name(out: Path, sources: Sequence[Path]) -> Path:
    """A configuration beside ``out`` that does not exist yet, called after the first recording."""
    called = _called(sources[0]) if sources else "bench"
    names = (out.with_name(f"{called}{'' if n == 1 else f'_{n}'}.yaml") for n in count(1))
    return next(path for path in names if not (path.exists() or path.is_symlink()))


def _called(source: Path) -> str:
    """The recording's name without its suffix, of nothing but what needs no quotes in a shell."""
    name = source.with_suffix("") if source.suffix.lower() == PACKED else source
    return re.sub(r"[^\w.-]+", "_", name.stem, flags=re.ASCII)[:MAX_PROPOSED_LETTERS].strip("-._") or "recording"
