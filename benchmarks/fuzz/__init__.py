"""Hostile input for everything that reads: wire bytes, configurations, recordings, object dictionaries."""
