"""Emulators of the bench's devices at wire level, run in a process of their own."""
