"""Field bench: recordings that look like measured ones, from rigs whose truth the product never sees, and a score.

Nothing here imports the product (a contract in pyproject.toml): own equations, own simulation, own oracle, own score.
"""
