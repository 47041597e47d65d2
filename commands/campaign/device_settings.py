"""Faults in a `bench` section that only the drivers can recognise, reported with all other faults of the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from typing import Any

from pydantic import BaseModel, ValidationError

from commands.campaign.backends import EMULATED, SIMULATED
from rig.config.bench import AmplifierConfig, CanConfig, GyroscopeConfig
from rig.config.parsing.yaml_text import KeyPath
from rig.errors import ConfigError

GYRO_PORT: KeyPath = ("bench", "gyroscope", "port")
CAN: KeyPath = ("bench", "amplifier", "can")
CAN_CHANNEL: KeyPath = (*CAN, "channel")
FAULTS: KeyPath = ("bench", "emulator", "faults")


def device_faults(data: Mapping[str, Any], played_on: str = SIMULATED) -> Iterator[tuple[KeyPath, str]]:
    """Path and text of everything that the drivers named by a configuration as read refuse.

    ``played_on`` is the backend: where that is the bench, the ports will be opened, so they are looked at too; where
    it is emulated, there have to be emulators. Values that their own section refuses are told elsewhere.
    """
    bench = data.get("bench")
    if (data.get("backend") != "bench" and played_on != EMULATED) or not isinstance(bench, dict):
        return
    from drivers.amplifiers import make_amplifier
    from drivers.gyroscopes import make_gyroscope

    yield from _refused("gyroscope", bench, GyroscopeConfig, make_gyroscope)
    yield from _refused("amplifier", bench, AmplifierConfig, make_amplifier)
    yield from _bus_faults(data)
    yield from _url_faults(data)
    yield from _injected_faults(data)
    if played_on == EMULATED:
        yield from _without_emulator(data)
    elif played_on == "bench" and bench.get("replay") is None:
        yield from _port_faults(data)


def _refused(
    name: str, bench: Mapping[str, Any], section: type[BaseModel], make: Callable[[Any], object]
) -> Iterator[tuple[KeyPath, str]]:
    from drivers.settings import SettingsError

    given = bench.get(name)
    if not isinstance(given, dict):
        return
    config, is_whole = _valid_part(given, section)
    if config is None:
        return
    try:
        make(config)
    except ConfigError as error:
        # With a default in the place of a value that was refused, only what stands by itself is surely wrong.
        if not is_whole and not isinstance(error, SettingsError):
            return
        for line in str(error).splitlines():
            key, colon, text = line.partition(": ")
            if colon and key.startswith(f"bench.{name}."):
                yield tuple(key.split(".")), text
            else:
                yield ("bench", name), line


def _bus_faults(data: Mapping[str, Any]) -> Iterator[tuple[KeyPath, str]]:
    from drivers.transport.can_link import bus_faults

    given = _at(data, CAN)
    config, is_whole = _valid_part(given, CanConfig) if isinstance(given, dict) else (None, False)
    if config is not None and is_whole:
        for key, text in bus_faults(config):
            yield (*CAN, *key.split(".")), text


def _url_faults(data: Mapping[str, Any]) -> Iterator[tuple[KeyPath, str]]:
    """A gyroscope's port that is a URL; the adapter's is told with its bus."""
    from drivers.transport.ports import url_fault

    port = _at(data, GYRO_PORT)
    fault = url_fault(port) if isinstance(port, str) else None
    if fault is not None:
        yield GYRO_PORT, fault


def _port_faults(data: Mapping[str, Any]) -> Iterator[tuple[KeyPath, str]]:
    from drivers.transport.ports import is_same_port

    gyro, channel = _at(data, GYRO_PORT), _at(data, CAN_CHANNEL)
    for path, value, section in ((GYRO_PORT, gyro, GyroscopeConfig), (CAN_CHANNEL, channel, CanConfig)):
        around = _at(data, path[:-1])
        misspelt = isinstance(around, dict) and not set(around) <= set(section.model_fields)
        if value is None and not misspelt:
            yield path, "is empty: name the port (`rig devices` lists them) or run with --emulate"
    if isinstance(gyro, str) and isinstance(channel, str) and is_same_port(gyro, channel.partition("@")[0]):
        yield (
            CAN_CHANNEL,
            f"{channel} is also the port of the gyroscope ({'.'.join(map(str, GYRO_PORT))}: {gyro}): give the CAN "
            "adapter its own port; `rig devices` lists all ports",
        )


def _injected_faults(data: Mapping[str, Any]) -> Iterator[tuple[KeyPath, str]]:
    """Names of injected faults that there are not."""
    given = _at(data, FAULTS)
    if not isinstance(given, list) or not given:
        return
    from sim_backend.emulators.faults.schedule import FAULTS as KNOWN

    for n, one in enumerate(given):
        name = one.get("fault") if isinstance(one, dict) else None
        if isinstance(name, str) and name not in KNOWN:
            near = get_close_matches(name, KNOWN, 1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(KNOWN)}"
            yield (*FAULTS, n, "fault"), f"there is no fault {name!r}; {hint}"


def _without_emulator(data: Mapping[str, Any]) -> Iterator[tuple[KeyPath, str]]:
    """Devices that have a driver and no emulator."""
    from drivers.amplifiers import DRIVERS as AMPLIFIERS
    from drivers.gyroscopes import DRIVERS as GYROSCOPES
    from sim_backend.emulators.bench import DRIVES
    from sim_backend.emulators.gyro import GYROS

    for name, drivers, emulators in (("gyroscope", GYROSCOPES, GYROS), ("amplifier", AMPLIFIERS, DRIVES)):
        path: KeyPath = ("bench", name, "device")
        device = _at(data, path)
        if isinstance(device, str) and device in drivers and device not in emulators:
            yield path, f"{device!r} has no emulator: choose one of {', '.join(emulators)}"


def _at(data: Any, path: KeyPath) -> Any:
    for part in path:
        data = data.get(part) if isinstance(data, dict) else None
    return data


def _valid_part(given: Mapping[str, Any], section: type[BaseModel]) -> tuple[Any, bool]:
    """The section without keys that it has not and values that it refuses, and whether there were none of the latter.

    None where nothing sound is left.
    """
    known = _known(given, section)
    try:
        return section.model_validate(known), True
    except ValidationError as wrong:
        for error in wrong.errors(include_url=False, include_input=False):
            known.pop(str(error["loc"][0]) if error["loc"] else "", None)
    try:
        return section.model_validate(known), False
    except ValidationError:
        return None, False


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
