"""Readers of recordings that need a library of an extra; only they may import it (``importlinter`` in pyproject.toml).

``rig.recording.readers`` loads one by name when a file of its format is read, so that nothing else depends on them.
"""
