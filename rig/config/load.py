"""From the path of a rig.yaml to a checked Config, or one error that lists everything wrong with it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PureWindowsPath
from typing import Any

from pydantic import ValidationError

from rig.config.parsing.messages import faults_of, place_of, shown
from rig.config.parsing.overrides import apply_override
from rig.config.parsing.yaml_text import Document, Fault, KeyPath, Place, dotted, parse, read_text
from rig.config.root import BACKENDS, Config, name_from_stem
from rig.errors import ConfigError

MAX_FAULTS_SHOWN = 25
# Places where the path of a model.yaml may stand for the mapping that it holds, and where effects may be named.
MODELS: tuple[KeyPath, ...] = (("model",), ("simulated", "platform"))
# And of a follow_up.yaml.
INCLUDES: tuple[KeyPath, ...] = (*MODELS, ("excitation",))
_A_FILE: Mapping[str | int, str] = {
    "model": "a model file", "platform": "a model file", "excitation": "an excitation file"
}  # fmt: skip
FurtherFaults = Callable[[Mapping[str, Any]], Iterable[tuple[KeyPath, str]]]
_FIRST: Mapping[str | int, str] = {"model": "inertia_kg_m2", "platform": "inertia_kg_m2", "excitation": "sets"}


@dataclass(frozen=True)
class LoadedConfig:
    """A checked configuration and what it was read from.

    ``text`` is the file as read, ``included`` the text of each model, excitation and effect file it names,
    ``overrides`` the ``--set`` texts in order: together they say exactly what was asked.
    """

    config: Config
    text: str
    path: Path
    overrides: tuple[str, ...] = ()
    included: Mapping[str, str] = field(default_factory=dict)

    @property
    def folder(self) -> Path:
        """The folder that relative paths in the file start from."""
        return self.path.parent


def load_config(
    path: str | Path,
    overrides: Sequence[str] = (),
    also_wrong: FurtherFaults = lambda data: (),
    announce: Callable[[str], None] = lambda text: None,
) -> LoadedConfig:
    """Read, override and check a configuration.

    ``also_wrong`` says what else is wrong with the mapping as read: paths and texts, told with all the rest.
    ``announce`` is told of every file of effects before its code is run.

    Raises ConfigError whose message has one line a fault: file, line, key, value, what is allowed.
    """
    path = Path(path)
    text = read_text(path)
    document = parse(text, str(path))
    included: dict[str, str] = {}
    if not isinstance(document.data, dict):
        raise ConfigError(
            f"{path}:1: has to be a mapping of keys (backend: ..., recorded: ...), not {shown(document.data)}"
        )
    _include_files(document, path.parent, included)
    for override in overrides:
        apply_override(document, override)
        _include_files(document, path.parent, included)  # the next one may reach into it
    _read_effects(document, path.parent, included, announce)
    config = _validate(document, name_from_stem(path.stem), also_wrong)
    return LoadedConfig(config, text, path, tuple(overrides), included)


def check_config(data: Mapping[str, Any], source: str) -> Config:
    """The configuration that a mapping as in rig.yaml stands for; files in it are relative to the current folder.

    ``data`` holds plain values as YAML would give them (str, int, float, bool, None, list, dict).

    Raises ConfigError whose message has one line a fault: ``source``, key, value, what is allowed.
    """
    document = Document(json.loads(json.dumps(data)), {(): Place(source)})
    included: dict[str, str] = {}
    _include_files(document, Path(), included)
    _read_effects(document, Path(), included, lambda text: None)
    return _validate(document, source, lambda data: ())


def config_as_recorded(
    text: str, path: Path, recorded_overrides: Sequence[str], included: Mapping[str, str], overrides: Sequence[str] = ()
) -> Config:
    """The configuration that a recording quotes, with its own ``--set`` texts and then those of today applied.

    ``path`` is where the file was, ``included`` the text of the files that it named. Nothing is read from disk and no
    code is run: a recording may come from anywhere.

    Raises ConfigError with a line a fault, also where the configuration names effects of the user's own.
    """
    document = parse(text, str(path))
    if not isinstance(document.data, dict):
        raise ConfigError(f"{path}:1: has to be a mapping of keys, not {shown(document.data)}")

    def kept(file: Path) -> str:
        named = [t for key, t in included.items() if PureWindowsPath(key).name == file.name]
        if str(file) not in included and len(named) != 1:
            raise ConfigError(f"{file}: its text is not in the recording: give the values themselves")
        return included.get(str(file), named[0] if named else "")

    _include_files(document, path.parent, {}, kept)
    for override in (*recorded_overrides, *overrides):
        apply_override(document, override)
        _include_files(document, path.parent, {}, kept)
    for key in MODELS:
        section: Any = document.data
        for part in key:
            section = section.get(part) if isinstance(section, dict) else None
        if isinstance(section, dict) and section.get("effects_from"):
            raise ConfigError(
                f"{path}: {dotted((*key, 'effects_from'))} names code, and code that a recording names is not run: "
                "review it, then identify from a rig.yaml that names both (backend: recorded)"
            )
    return _validate(document, name_from_stem(PureWindowsPath(path).stem), lambda data: ())


def _include_files(
    document: Document, folder: Path, included: dict[str, str], read: Callable[[Path], str] = read_text
) -> None:
    for key in INCLUDES:
        parent: Any = document.data
        for part in key[:-1]:
            parent = parent.get(part) if isinstance(parent, dict) else None
        if isinstance(parent, dict) and isinstance(parent.get(key[-1]), str):
            parent[key[-1]] = _included(document, key, folder / parent[key[-1]], included, read)


def _included(
    document: Document, key: KeyPath, path: Path, included: dict[str, str], read: Callable[[Path], str]
) -> Any:
    """The mapping in a file that stands for a section, with its places and faults added to ``document``."""
    try:
        included[str(path)] = read(path)
        model = parse(included[str(path)], str(path))
    except ConfigError as error:
        document.faults.append(Fault(place_of(document, key), key, f"names {_A_FILE[key[-1]]}: {error}"))
        return {}
    inside: KeyPath = ()
    name = "excitation" if key[-1] == "excitation" else "model"
    if isinstance(model.data, dict) and list(model.data) == [name]:  # together with its key
        inside, model.data = (name,), model.data[name]
    if not isinstance(model.data, dict):
        where = place_of(model, ())
        text = f"has to hold a mapping ({_FIRST[key[-1]]}: ...), not {shown(model.data)}"
        document.faults.append(Fault(where, key, text))
        return {}
    _count_from(model.data, path.parent)
    for path_in_file, place in model.places.items():
        if path_in_file[: len(inside)] == inside:
            document.places[key + path_in_file[len(inside) :]] = place
    for fault in model.faults:
        document.faults.append(Fault(fault.place, key + fault.path[len(inside) :], fault.text))
    return model.data


def _count_from(model: dict[str, Any], folder: Path) -> None:
    """Effect files named by a model.yaml are relative to it, not to the file that names the model."""
    files = model.get("effects_from")
    files = [files] if isinstance(files, str) else files
    if isinstance(files, list):
        model["effects_from"] = [str(folder / file) if isinstance(file, str) else file for file in files]


def _read_effects(document: Document, folder: Path, included: dict[str, str], announce: Callable[[str], None]) -> None:
    """Run the files named under ``effects_from``: the names that they define may stand anywhere in the file."""
    for key in MODELS:
        section: Any = document.data
        for part in key:
            section = section.get(part) if isinstance(section, dict) else None
        files = section.get("effects_from") if isinstance(section, dict) else None
        if isinstance(files, str):
            files = section["effects_from"] = [files]
        for file in files if isinstance(files, list) else ():
            if not isinstance(file, str):
                continue  # said by the check of the whole
            from rig import effects  # noqa: PLC0415  compiled kernels: only where there is a file

            path, where = folder / file, (*key, "effects_from")
            try:
                _require_within(path, folder)
                announce(f"runs code: {path.resolve()} (named by {dotted(where)})")
                included[str(path)] = effects.read_file(path)
            except ConfigError as error:
                document.faults.append(Fault(place_of(document, where), where, str(error)))


def _require_within(path: Path, folder: Path) -> None:
    """Raise ConfigError where code does not lie beside the configuration or below it, links followed.

    A configuration that somebody sent must not run what happens to lie on this machine.
    """
    try:
        is_within = path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # no name of a file
        is_within = False
    if not is_within:
        raise ConfigError(
            f"{str(path)[:200]} is not in the folder of this configuration ({folder.absolute()}) or below it, "
            "and its code is not run: review it, then copy it there"
        )


def _validate(document: Document, default_name: str, also_wrong: FurtherFaults) -> Config:
    data = document.data
    data.setdefault("name", default_name)
    _require_backend_section(document)
    for section in Config.model_fields:
        if section in data and data[section] is None and section not in ("name", "backend"):
            data[section] = {}  # `simulated:` with nothing under it means: all defaults
    config: Config | None = None
    try:
        # As JSON, strictly: a list may be a tuple there, but text is no number and true is not 1.
        config = Config.model_validate_json(json.dumps(data), strict=True)
    except ValidationError as error:
        known = {fault.path for fault in document.faults}
        document.faults += [f for f in faults_of(error, document, Config) if f.path not in known]
    known = {fault.path for fault in document.faults}
    document.faults += [
        Fault(place_of(document, path), path, text) for path, text in also_wrong(data) if path not in known
    ]
    if document.faults or config is None:
        raise ConfigError(_listing(document.faults))
    return config


def _require_backend_section(document: Document) -> None:
    backend = document.data.get("backend")
    if backend in BACKENDS and backend not in document.data:
        text = f"is {backend}, so the section `{backend}:` is required: add it"
        document.faults.append(Fault(place_of(document, ("backend",)), ("backend",), text))


def _listing(faults: Sequence[Fault]) -> str:
    ordered = sorted(faults, key=lambda f: (f.place.source, f.place.line or 0))
    lines = [str(fault) for fault in ordered[:MAX_FAULTS_SHOWN]]
    if len(ordered) > MAX_FAULTS_SHOWN:
        lines.append(f"... and {len(ordered) - MAX_FAULTS_SHOWN} more; correct these first")
    return "\n".join(lines)
