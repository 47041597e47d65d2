"""Runs simulated from a parameter vector, with the sensitivities to every parameter."""
