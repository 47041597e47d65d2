"""Faults on request: what can go wrong on a bench, done to an emulated one."""
