"""YAML text to plain values, each with the place it came from; every fault of the text at once.

Only mappings, lists and plain scalars: no tags, no merge keys, no duplicate keys. Scalars follow YAML 1.2
(`1e-3` is a number, `on` and `1:30` are text). Size and expansion are bounded, so that a file made to
exhaust the memory is refused instead.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from rig.errors import ConfigError

# Endings of recordings: whoever gives one wants it identified, and no key of it will be right.
RECORDINGS = frozenset(
    (
        ".csv",
        ".tsv",
        ".gz",
        ".lvm",
        ".npz",
        ".mat",
        ".h5",
        ".hdf5",
        ".parquet",
        ".mf4",
        ".mdf",
        ".tdms",
        ".bag",
        ".mcap",
        ".db3",
    )
)
MAX_CONFIG_BYTES = 256 * 1024
MAX_NODES = 20_000
MAX_EXPANDED_CHARACTERS = 2_000_000
MAX_CONFIG_LEVELS = 40
MAX_BRACKETS = 200  # open at once, those in quotes and comments counted too
_BRACKETS = re.compile(r"[\[\]{}]")

KeyPath = tuple[str | int, ...]


@dataclass(frozen=True)
class Place:
    """Where a value was written: a file and line, or the text of a --set."""

    source: str
    line: int | None = None

    def __str__(self) -> str:
        return self.source if self.line is None else f"{self.source}:{self.line}"


@dataclass(frozen=True)
class Fault:
    """One thing wrong, where, and what to do."""

    place: Place
    path: KeyPath
    text: str

    def __str__(self) -> str:
        key = dotted(self.path)
        return f"{self.place}: {key + ': ' if key else ''}{self.text}"


@dataclass
class Document:
    """Plain values with the place of each, and what is wrong with the text itself."""

    data: Any
    places: dict[KeyPath, Place] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)


def dotted(path: KeyPath) -> str:
    """A key path as --set takes it: `recorded.runs.0.file`."""
    return ".".join(str(part) for part in path)


class _Loader(yaml.SafeLoader):
    """The pure-Python composer (its recursion fails cleanly) with YAML 1.2's idea of scalars."""

    yaml_implicit_resolvers: dict[Any, Any] = {}  # noqa: RUF012 (as the base class declares it)


_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+|0x[0-9a-fA-F]+", list("-+0123456789")),
    ("float", rf"{_NUMBER}|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)", list("-+0123456789.")),
    ("merge", r"<<", ["<"]),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), _first)


def read_text(path: Path) -> str:
    """The text of a configuration file.

    Raises ConfigError where it is missing, no regular file, too large, empty or not UTF-8 text.
    """
    try:
        if path.is_dir():
            raise ConfigError(f"{path}: is a folder: give the yaml file in it")
        if not path.exists():
            raise ConfigError(f"{path}: no such file: check the name and the folder you are in ({Path.cwd()})")
        if not path.is_file():
            raise ConfigError(f"{path}: is not a regular file (a device or pipe): give a yaml file")
        if path.suffix.lower() in RECORDINGS:
            raise ConfigError(
                f"{path}: is a recording, not a configuration: `rig init {path}` writes one that reads it"
            )
        with path.open("rb") as file:
            raw = file.read(MAX_CONFIG_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigError(f"{path}: cannot be read: {reason}; check the path and its permissions") from error
    if len(raw) > MAX_CONFIG_BYTES:
        raise ConfigError(
            f"{path}: larger than {MAX_CONFIG_BYTES} bytes, so it is probably a recording: name recordings under "
            "recorded.runs of a configuration"
        )
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise ConfigError(
            f"{path}:{line}: byte 0x{raw[error.start]:02x} is not UTF-8 text: save the file as UTF-8"
        ) from error
    if not text.strip():
        raise ConfigError(f"{path}: the file is empty: it needs at least `backend:` and that section")
    return text


def parse(text: str, source: str, *, lines: bool = True) -> Document:
    """Values and places of a YAML text; ``lines`` False for the text of a --set, which has none.

    Raises ConfigError where the text is no YAML or breaks a bound; milder faults are in ``faults``.
    """
    loader = None
    _refuse_deep_brackets(text, source)
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(source, mark.line + 1 if mark and lines else None)
        problem = " ".join(str(part) for part in (error.context, error.problem) if part)
        raise ConfigError(f"{place}: not YAML: {problem}; {_syntax_cure(problem)}") from error
    except yaml.YAMLError as error:
        raise ConfigError(f"{source}: not YAML: {error}; save it as plain UTF-8 text") from error
    except RecursionError as error:
        raise ConfigError(
            f"{source}: nested too deeply: a configuration has at most {MAX_CONFIG_LEVELS} levels"
        ) from error
    finally:
        if loader is not None:
            loader.dispose()
    walk = _Walk(source, lines)
    return Document(None if node is None else walk.value(node, (), 0), walk.places, walk.faults)


def _refuse_deep_brackets(text: str, source: str) -> None:
    """Raise ConfigError where brackets are nested so deeply that the scanner alone would take seconds."""
    depth = 0
    for bracket in _BRACKETS.finditer(text):
        depth = depth + 1 if bracket.group() in "[{" else max(0, depth - 1)
        if depth > MAX_BRACKETS:
            raise ConfigError(f"{source}: nested too deeply: a configuration has at most {MAX_CONFIG_LEVELS} levels")


def _syntax_cure(problem: str) -> str:
    if "'\\t'" in problem:
        return "indent with spaces, never with tabs"
    if "mapping values are not allowed" in problem:
        return "a value that holds a colon needs quotes, or the indentation of this line is off"
    if "undefined alias" in problem:
        return "put quotes around a value that begins with *"
    return "check indentation, quotes and brackets on this line and the one before"


class _Walk:
    """Turns nodes into values once, counting what the aliases expand to."""

    def __init__(self, source: str, lines: bool) -> None:
        self.source, self.lines = source, lines
        self.places: dict[KeyPath, Place] = {}
        self.faults: list[Fault] = []
        self._nodes = 0
        self._characters = 0

    def value(self, node: Node, path: KeyPath, depth: int) -> Any:
        place = self.places.setdefault(path, self._place(node))
        self._count(node, place, depth)
        if isinstance(node, MappingNode) and node.tag.endswith(":map"):
            return self._mapping(node, path, depth)
        if isinstance(node, SequenceNode) and node.tag.endswith(":seq"):
            return [self.value(item, (*path, i), depth + 1) for i, item in enumerate(node.value)]
        if isinstance(node, ScalarNode):
            return self._scalar(node, place, path)
        self._fault(place, path, f"tag {node.tag[:60]!r} is not allowed: write plain mappings, lists and values")
        return None

    def _place(self, node: Node) -> Place:
        return Place(self.source, node.start_mark.line + 1 if self.lines else None)

    def _fault(self, place: Place, path: KeyPath, text: str) -> None:
        self.faults.append(Fault(place, path, text))

    def _count(self, node: Node, place: Place, depth: int) -> None:
        self._nodes += 1
        self._characters += len(node.value) if isinstance(node, ScalarNode) else 0
        if self._nodes > MAX_NODES or self._characters > MAX_EXPANDED_CHARACTERS or depth > MAX_CONFIG_LEVELS:
            raise ConfigError(
                f"{place}: the file expands to more than {MAX_NODES} values or {MAX_CONFIG_LEVELS} levels "
                "(aliases of aliases, or an alias inside itself?): write the values out"
            )

    def _mapping(self, node: MappingNode, path: KeyPath, depth: int) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            place = self._place(key_node)
            if not isinstance(key_node, ScalarNode):
                self._fault(place, path, "a key has to be plain text, not a list or mapping")
                continue
            if key_node.tag.endswith(":merge"):
                self._fault(place, path, "merge keys (<<) are not supported: write the keys out")
                continue
            key = str(key_node.value)
            inner = (*path, key)
            if key in result:
                first = self.places[inner]
                also = f" (first on line {first.line})" if first.line else ""
                self._fault(place, inner, f"the key is given twice{also}: keep one")
                continue
            self.places[inner] = place
            self._characters += len(key)
            result[key] = self.value(value_node, inner, depth + 1)
        return result

    def _scalar(self, node: ScalarNode, place: Place, path: KeyPath) -> Any:
        text, kind = str(node.value), node.tag.rpartition(":")[2]
        if kind in ("str", "merge"):
            return text
        if kind == "null":
            return None
        if kind == "bool" and text.lower() in ("true", "false"):
            return text.lower() == "true"
        if kind in ("int", "float"):
            return self._number(text, kind, place, path)
        self._fault(place, path, f"tag {node.tag[:60]!r} is not allowed: write the plain value")
        return None

    def _number(self, text: str, kind: str, place: Place, path: KeyPath) -> int | float | None:
        try:
            if kind == "float":
                number: int | float = float(re.sub(r"\.(?=[a-zA-Z])", "", text))
            else:
                number = int(text, 16) if text.lower().startswith("0x") else int(text)
        except ValueError:
            self._fault(place, path, f"{text[:40]!r} is not a number")
            return None
        # In this order: a whole number of hundreds of digits is no float that could be asked whether it is finite.
        if abs(number) > 1e300 or not math.isfinite(number):
            self._fault(place, path, f"{text[:40]} is not allowed: give a finite number")
            return None
        # Python's whole numbers have no end; beyond 64 bits none is meant as one.
        return float(number) if abs(number) >= 2**63 else number
