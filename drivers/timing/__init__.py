"""Clocks: a device's time in the host's seconds, while a campaign plays and once it is over."""
