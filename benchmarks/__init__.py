"""Measurements of the product; `blind` is a package of its own, the rest are scripts."""
