"""Blind bench: recordings of platforms whose truth the product never sees, and a score of what it said of them.

Nothing here imports the product (a contract in pyproject.toml): own equations, own integrator, own score.
"""
