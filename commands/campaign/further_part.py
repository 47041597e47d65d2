"""What the further parts of a campaign share: the configuration that they are played with."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

from rig.config.excitation import ExcitationConfig
from rig.config.load import LoadedConfig
from rig.config.model import ModelConfig
from rig.platform import Platform

FURTHER_PART_SEED_STEP = 1_000_003  # a simulated gyro must not repeat its noise


def further_config(
    loaded: LoadedConfig, model: Platform | None, number: int, excitation: ExcitationConfig | None = None
) -> LoadedConfig:
    """The same configuration with the identified platform to look ahead with, and with another excitation if given.

    ``number`` is that of the part, from 1: a simulated sensor draws other noise in each.
    """
    config = loaded.config
    seed = (config.simulated.seed + number * FURTHER_PART_SEED_STEP) % 2**32
    changed: dict[str, Any] = {"simulated": config.simulated.model_copy(update={"seed": seed})}
    if excitation is not None:
        changed["excitation"] = excitation
    if model is not None:
        try:
            changed["model"] = ModelConfig.from_platform(model)
        except ValueError:  # numbers that no model may have: the declared one looks ahead
            changed.pop("model", None)
    return replace(loaded, config=config.model_copy(update=changed))


def on_terminal() -> bool:
    """Whether somebody can be asked."""
    return sys.stdin is not None and sys.stdin.isatty()
