"""Frequency responses, measured and of the model."""
