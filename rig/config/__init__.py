"""Configuration: rig.yaml read, checked and frozen. `rig.config.load.load_config` is the way in."""
