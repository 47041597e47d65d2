"""Recordings: what was played and measured, however it came about."""

from rig.recording.run import Recording, Run

__all__ = ["Recording", "Run"]
