"""Configuration: rig.yaml read, checked and frozen."""

from rig.config.load import LoadedConfig, load_config
from rig.config.root import Config

__all__ = ["Config", "LoadedConfig", "load_config"]
