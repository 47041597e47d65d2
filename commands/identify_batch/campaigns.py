"""Which recorded campaigns a pattern matches, and the files that decide what comes out of each."""

from __future__ import annotations

import glob
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.config.load import INCLUDES, MODELS
from rig.config.parsing.overrides import apply_override
from rig.config.parsing.yaml_text import parse, read_text
from rig.errors import ConfigError, UsageError

RECORDING_FILE = "recording.h5"
CONFIG_SUFFIXES = (".yaml", ".yml")
PIECE_BYTES = 1 << 20  # of a file that is hashed
# Effects of one's own and measured channels are known to a whole process, and must not reach the next campaign.
KEEP_APART = ("effects_from", "channels")


@dataclass(frozen=True)
class Job:
    """One campaign as a worker takes it.

    Attributes
    ----------
    path
        As the pattern matched it; this is the row's name.
    file
        The same, absolute: a worker has a working folder of its own.
    overrides
        The ``--set`` texts, those of ``--seed`` last.
    content
        SHA-256 of all that decides the row: files, overrides, version of this program.
    results
        Where the campaign's results folder goes, absolute, or None.
    """

    path: str
    file: str
    overrides: tuple[str, ...]
    content: str
    results: str | None = None

    @property
    def is_recording(self) -> bool:
        """Whether it is a recording.h5, which quotes its configuration, and no rig.yaml."""
        return Path(self.file).suffix.lower() not in CONFIG_SUFFIXES


def campaigns_of(pattern: str) -> tuple[list[str], list[str]]:
    """Paths of the campaigns that ``pattern`` matches, sorted, and of what it matches besides.

    A folder stands for the recording.h5 in it; ``**`` matches folders at any depth. A file counts as a campaign if it
    ends in .h5, or in .yaml or .yml and does not say another backend than ``recorded``.

    Raises UsageError where no campaign is matched.
    """
    found, others = set(), []
    matches = glob.glob(str(Path(pattern).expanduser()), recursive=True)  # noqa: PTH207 (Path takes no absolute one)
    for match in sorted(matches):
        path = Path(match)
        path = path / RECORDING_FILE if (path / RECORDING_FILE).is_file() else path
        if path.is_file() and (path.suffix.lower() == ".h5" or _is_recorded(path)):
            found.add(path.as_posix())
        else:
            others.append(match)
    if not found:
        raise UsageError(
            f"{pattern}: matches no recorded campaign ({len(others)} other file(s) or folder(s)): give a pattern that "
            f"matches {RECORDING_FILE} of results folders, or rig.yaml files with backend: recorded, in quotation "
            "marks so that the shell does not expand it, e.g. 'runs/*/recording.h5'"
        )
    return sorted(found), [path for path in others if Path(path).as_posix() not in found]


def _is_recorded(path: Path) -> bool:
    if path.suffix.lower() not in CONFIG_SUFFIXES:
        return False
    try:
        data = parse(read_text(path), str(path)).data
    except ConfigError:
        return True  # what cannot be read is a row that says so
    return isinstance(data, dict) and data.get("backend") == "recorded"


def content_of(file: Path, overrides: Sequence[str], version: str) -> str:
    """SHA-256, hexadecimal, of all that decides what comes out of a campaign; a missing file counts as missing."""
    whole = hashlib.sha256(json.dumps([list(overrides), version]).encode())
    for one in inputs_of(file, overrides):
        whole.update(f"\0{one.name}\0".encode(errors="surrogateescape"))
        whole.update(_digest(one))
    return whole.hexdigest()


def _digest(file: Path) -> bytes:
    one = hashlib.sha256()
    try:
        if not file.is_file():  # a pipe would never end
            return b"no file"
        with file.open("rb") as opened:
            while piece := opened.read(PIECE_BYTES):
                one.update(piece)
    except (OSError, ValueError) as error:
        return type(error).__name__.encode()
    return one.digest()


def inputs_of(file: Path, overrides: Sequence[str]) -> list[Path]:
    """The campaign's file and every file that it names; code is not run, and what is wrong is left to the worker."""
    if file.suffix.lower() not in CONFIG_SUFFIXES:
        return [file]
    try:
        document = parse(read_text(file), str(file))
        for override in overrides:
            apply_override(document, override)
    except ConfigError:
        return [file]
    named: list[Path] = []
    for key in INCLUDES:
        section, folder = _at(document.data, key), file.parent
        if isinstance(section, str):
            named.append(folder / section)
            section, folder = _section_of(named[-1], key[-1]), named[-1].parent
        if key in MODELS and isinstance(section, dict):
            named += [folder / code for code in _texts(section.get("effects_from"))]
    runs = _at(document.data, ("recorded", "runs"))
    files = [run.get("file") for run in runs if isinstance(run, dict)] if isinstance(runs, list) else []
    return [file, *named, *(_expanded(file.parent, f) for f in files if isinstance(f, str))]


def keeps_apart(texts: Sequence[str]) -> bool:
    """Whether a campaign with these texts of configuration and ``--set`` needs a process of its own."""
    return any(word in text for text in texts for word in KEEP_APART)


def _section_of(path: Path, key: str | int) -> Any:
    try:
        data = parse(read_text(path), str(path)).data
    except ConfigError:
        return None
    return data.get(key, data) if isinstance(data, dict) else None


def _at(data: Any, key: Sequence[str | int]) -> Any:
    for part in key:
        data = data.get(part) if isinstance(data, dict) else None
    return data


def _texts(value: Any) -> list[str]:
    return [value] if isinstance(value, str) else [v for v in value or () if isinstance(v, str)]


def _expanded(folder: Path, file: str) -> Path:
    try:
        return folder / Path(file).expanduser()
    except RuntimeError:  # the home folder is unknown; the reader says so
        return folder / file
