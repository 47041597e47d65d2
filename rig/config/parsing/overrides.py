"""`--set a.b.c=value`: one key of the file replaced from the command line."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Any

from rig.config.parsing.yaml_text import Document, KeyPath, Place, dotted, parse
from rig.errors import ConfigError


def apply_override(document: Document, text: str) -> None:
    """Put the value of ``a.b.c=value`` into ``document``; the value is read as YAML.

    Missing mappings on the way are made; a list takes an index that exists. Raises ConfigError that
    names the text of the --set.
    """
    source = f"--set {text[:200]}"
    key, equals, value = text.partition("=")
    parts = [part.strip() for part in key.split(".")]
    if not equals or not all(parts):
        raise ConfigError(f"{source}: has to be KEY=VALUE, e.g. --set identify.genetic.population=500")
    parsed = parse(value, source, lines=False)
    place = Place(source)
    path = _put(document, parts, parsed.data, source)
    for old in [p for p in document.places if p[: len(path)] == path]:
        del document.places[old]
    document.places.update({path + inner: place for inner in parsed.places} | {path: place})
    for fault in parsed.faults:
        document.faults.append(type(fault)(place, path + fault.path, fault.text))
    # What was wrong with a value that is now replaced does not matter any more.
    document.faults[:] = [f for f in document.faults if f.path[: len(path)] != path or f.place == place]


def _put(document: Document, parts: Sequence[str], value: Any, source: str) -> KeyPath:
    if document.data is None:
        document.data = {}
    container: Any = document.data
    path: KeyPath = ()
    for i, part in enumerate(parts):
        step: str | int = part
        if isinstance(container, list):
            step = _index(container, part, path, source)
        elif not isinstance(container, dict):
            raise ConfigError(f"{source}: {dotted(path)} is the value {container!r:.60}, it has no key {part!r}")
        elif part.isdecimal() and part not in container:
            raise ConfigError(
                f"{source}: {dotted(path) or 'the file'} is not written as a list there, so it has no item {part}: "
                f"give the whole list, e.g. --set '{dotted(path)}=[...]'"
            )
        path = (*path, step)
        if i == len(parts) - 1:
            container[step] = value
            return path
        if isinstance(container, dict) and container.get(part) is None:
            container[part] = {}
        container = container[step]
    raise AssertionError("a key has at least one part")


def _index(items: list[Any], part: str, path: KeyPath, source: str) -> int:
    if not part.isdecimal() or int(part) >= len(items):
        near = difflib.get_close_matches(part, [str(i) for i in range(len(items))], n=1, cutoff=0.0)
        raise ConfigError(
            f"{source}: {dotted(path)} is a list of {len(items)}: use a number from 0 to {len(items) - 1}"
            + (f", e.g. {dotted((*path, near[0]))}" if near else "")
        )
    return int(part)
