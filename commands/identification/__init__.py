"""Identifying what was played or read, and proving what was named: shared by `identify-run` and `rig prove`."""
