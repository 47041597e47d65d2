"""Amplifiers: one file a device, one line here."""

from __future__ import annotations

from importlib import import_module

from drivers.amplifiers.base import Amplifier
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
    module, _, name = DRIVERS[config.device].partition(":")
    driver: Amplifier = getattr(import_module(module), name)(config)
    return driver
