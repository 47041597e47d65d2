"""The identified model for other programs, one file a format; a new one is a new file and a line in ``_BY_NAME``."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

from rig.errors import InputError

if TYPE_CHECKING:
    from identify.report.model_formats.description import ModelDescription

# Format -> the file it is written to, and the module with ``content`` that makes its text or bytes.
_BY_NAME = {
    "model-json": ("platform.json", "json_model"),
    "model-mat": ("platform.mat", "mat_model"),
    "modelica": ("Platform.mo", "modelica"),
}


def names() -> tuple[str, ...]:
    """Every format that a model can be written in."""
    return tuple(_BY_NAME)


def file_of(name: str) -> str:
    """What the file of a format is called. Raises KeyError."""
    return _BY_NAME[name][0]


def content_of(name: str, model: ModelDescription) -> str | bytes:
    """The text or the bytes of a format. Raises KeyError for one that is not known."""
    make: Callable[[ModelDescription], str | bytes] = import_module(f"{__name__}.{_BY_NAME[name][1]}").content
    return make(model)


def name_for(suffix: str) -> str:
    """The format whose files end so: ".json", ".mat" or ".mo". Raises InputError."""
    found = {f".{file.rpartition('.')[2]}": name for name, (file, _) in _BY_NAME.items()}
    if suffix.lower() not in found:
        raise InputError(f"a model is written to a file that ends in {', '.join(found)}, not in {suffix!r:.20}")
    return found[suffix.lower()]
