"""Reads recordings, estimates the platform's parameters and names what the model is missing."""
