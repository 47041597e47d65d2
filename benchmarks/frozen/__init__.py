"""Frozen recordings, and what the product says of them before and after a change that may change nothing."""
