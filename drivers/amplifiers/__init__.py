"""Amplifiers: one file a device, one line here."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from drivers.amplifiers.base import Amplifier
from drivers.settings import Settings
from rig.config.bench import AmplifierConfig
from rig.errors import ConfigError

DRIVERS = {
    "cia402": "drivers.amplifiers.cia402:Cia402",
    "odrive": "drivers.amplifiers.odrive:Odrive",
    "moteus": "drivers.amplifiers.moteus:Moteus",
    "vesc": "drivers.amplifiers.vesc:Vesc",
}
"""`bench.amplifier.device` -> class. Modules are imported when they are wanted."""


def make_amplifier(config: AmplifierConfig) -> Amplifier:
    """The driver that the configuration names.

    Raises
    ------
    ConfigError
        If there is no such driver, or it does not accept its settings.
    """
    if config.device not in DRIVERS:
        raise ConfigError(f"bench.amplifier.device: no driver called {config.device!r}; there are {', '.join(DRIVERS)}")
    driver: Amplifier = _class_of(config.device)(config)
    return driver


def settings_model(device: str) -> type[Settings] | None:
    """The settings that a driver of ``DRIVERS`` takes; None where it does not state them."""
    model: type[Settings] | None = _class_of(device).settings_model
    return model


def _class_of(device: str) -> Any:
    module, _, name = DRIVERS[device].partition(":")
    return getattr(import_module(module), name)
