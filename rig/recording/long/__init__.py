"""Recordings too long to be identified sample by sample: read in blocks, low-passed, decimated, cut to a span."""
