"""What only the drivers know to be wrong in a `bench` section, so that it is told with everything else in the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from rig.config.bench import AmplifierConfig, GyroscopeConfig
from rig.config.yaml_text import KeyPath
from rig.errors import ConfigError


def device_faults(data: Mapping[str, Any]) -> Iterator[tuple[KeyPath, str]]:
    """Path and text of everything that the drivers named by a configuration as read refuse.

    A device whose own section is unsound apart from unknown keys is left out: that is told first.
    """
    bench = data.get("bench")
    if data.get("backend") != "bench" or not isinstance(bench, dict):
        return
    from drivers.amplifiers import make_amplifier
    from drivers.gyroscopes import make_gyroscope

    yield from _refused("gyroscope", bench, GyroscopeConfig, make_gyroscope)
    yield from _refused("amplifier", bench, AmplifierConfig, make_amplifier)


def _refused(
    name: str, bench: Mapping[str, Any], section: type[BaseModel], make: Callable[[Any], object]
) -> Iterator[tuple[KeyPath, str]]:
    given = bench.get(name)
    if not isinstance(given, dict):
        return
    try:
        make(section.model_validate(_known(given, section)))
    except ValidationError:
        return
    except ConfigError as error:
        for line in str(error).splitlines():
            key, colon, text = line.partition(": ")
            if colon and key.startswith(f"bench.{name}."):
                yield tuple(key.split(".")), text
            else:
                yield ("bench", name), line


def _known(given: Mapping[str, Any], section: type[BaseModel]) -> dict[str, Any]:
    """Without keys that the section has not, also one level below: those are told elsewhere."""
    known: dict[str, Any] = {}
    for key, value in given.items():
        field = section.model_fields.get(key)
        if field is None:
            continue
        inner: Any = field.annotation
        is_section = isinstance(inner, type) and issubclass(inner, BaseModel) and isinstance(value, dict)
        known[key] = _known(value, inner) if is_section else value
    return known
