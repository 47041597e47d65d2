"""Effects from outside the package: of installed packages, and of Python files that a rig.yaml names.

An installed package offers effects as entry points of the group ``isp_rig.effects``: name of the effect ->
the Effect object. A file holds one as ``EFFECT``, or several as ``EFFECTS``. Both are code that the user
chose to run, with all that code may do.
"""

from __future__ import annotations

import importlib.util
import re
import sys
import traceback
from collections.abc import Collection
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from rig.effects.base import FILTER_SIGNATURE, KERNEL_SIGNATURE, Effect, Place
from rig.errors import ConfigError

GROUP = "isp_rig.effects"
_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class _FromFile:
    effect: Effect
    path: Path
    text: str


_FILES: dict[str, _FromFile] = {}


@cache
def installed() -> dict[str, EntryPoint]:
    """Effects that installed packages offer, by name; nothing of theirs is imported yet."""
    return {point.name: point for point in entry_points(group=GROUP)}


def names(known: Collection[str]) -> tuple[str, ...]:
    """Names of all effects from outside, those of packages first.

    Raises
    ------
    ConfigError
        Where a package offers an effect under a name that is taken.
    """
    for name, point in installed().items():
        if name in known:
            raise ConfigError(f"{_package(point)} offers an effect {name!r}, but that name is taken: uninstall it")
    return (*installed(), *(name for name in _FILES if name not in installed()))


@cache
def _of_package(name: str) -> Effect:
    point = installed()[name]
    try:
        effect = point.load()
    except Exception as error:  # somebody else's code: whatever it raises is said with its package
        raise ConfigError(f"{_package(point)}: effect {name!r} cannot be loaded: {_said(error)}") from error
    fault = _fault(effect) or (f"its name is {effect.name!r}" if effect.name != name else "")
    if fault:
        raise ConfigError(f"{_package(point)}: effect {name!r}: {fault}")
    assert isinstance(effect, Effect)  # _fault has looked at it
    return effect


def get(name: str) -> Effect:
    """The effect of that name. Raises KeyError where there is none, ConfigError where a package's is broken."""
    return _of_package(name) if name in installed() else _FILES[name].effect


def file_of(name: str) -> Path | None:
    """The file that an effect was read from, None for all others."""
    return _FILES[name].path if name in _FILES else None


def read_file(path: Path, known: Collection[str]) -> str:
    """Run a Python file and make its effects known for the rest of the program. Returns the file's text.

    Parameters
    ----------
    known
        Names that are taken.

    Raises
    ------
    ConfigError
        Where the file cannot be read or run, holds no effect, or one that cannot work.
    """
    path = path.resolve()
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} cannot be read: {error}") from error
    held = [f for f in _FILES.values() if f.path == path]
    if held and all(f.text == text for f in held):
        return text
    if held:
        raise ConfigError(f"{path} has changed since it was read: start the program again")
    for effect in _effects_in(path):
        taken = effect.name in known or effect.name in installed() or effect.name in _FILES
        fault = f"the name {effect.name!r} is taken: give it another" if taken else ""
        if fault:
            raise ConfigError(f"{path}: {fault}")
        _FILES[effect.name] = _FromFile(effect, path, text)
    return text


def _effects_in(path: Path) -> list[Effect]:
    spec = importlib.util.spec_from_file_location(f"effects_from_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ConfigError(f"{path} is not a Python file: its name has to end in .py")
    module = importlib.util.module_from_spec(spec)
    # What Numba compiles of it is kept beside the file under the module's name, and has to find it there next time.
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # the user's code: whatever it raises is said with its line
        raise ConfigError(f"{path}{_line_in(error, path)}: {_said(error)}") from error
    found = list(getattr(module, "EFFECTS", ())) or [getattr(module, "EFFECT", None)]
    if found == [None]:
        raise ConfigError(f"{path} defines no effect: add a line `EFFECT = Effect(...)`, or `EFFECTS = (..., ...)`")
    for effect in found:
        fault = _fault(effect)
        if fault:
            raise ConfigError(f"{path}: {getattr(effect, 'name', 'EFFECT')}: {fault}")
    return found


def _fault(effect: Any) -> str:
    """What keeps an object from being an effect that works; empty where nothing does."""
    if not isinstance(effect, Effect):
        return f"is a {type(effect).__name__}, not a rig.effects.Effect"
    given = [p.name for p in effect.parameters]
    searched = [p.name for p in effect.parameters if not p.linear and p.start is None]
    filters = effect.place in (Place.DRIVE, Place.SENSOR)
    wanted = FILTER_SIGNATURE if filters else KERNEL_SIGNATURE
    faults = (
        (not _NAME.fullmatch(effect.name), "a name is lower-case letters, digits and _, as in my_effect"),
        (
            not given or len(set(given)) < len(given),
            "needs at least one parameter, and every parameter a name of its own",
        ),
        (
            searched,
            f"parameter {''.join(searched[:1])} is not linear, so the fit needs an initial value: give it `start=`",
        ),
        (
            getattr(effect.kernel, "_sig", None) != wanted,
            f"its kernel has to be decorated with @{'filter_kernel' if filters else 'kernel'} of rig.effects",
        ),
        ("**" in effect.formula, "its formula is written to C and Modelica, too, which have no **: write x * x"),
    )
    return next((said for is_wrong, said in faults if is_wrong), "")


def _package(point: EntryPoint) -> str:
    return f"package {point.dist.name}" if point.dist else "an installed package"


def _said(error: BaseException) -> str:
    return f"{type(error).__name__}: {str(error).strip().splitlines()[0] if str(error).strip() else 'no message'}"


def _line_in(error: BaseException, path: Path) -> str:
    if isinstance(error, SyntaxError) and error.lineno:
        return f":{error.lineno}"
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if Path(f.filename) == path]
    return f":{lines[-1]}" if lines else ""
