"""Replay: a raw capture in place of the devices."""

from drivers.replay.rig import ReplayRig

__all__ = ["ReplayRig"]
