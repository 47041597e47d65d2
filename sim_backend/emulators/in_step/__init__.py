"""Emulated devices in step with the bench: time that passes only while the bench waits for it."""
