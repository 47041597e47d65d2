"""The genetic algorithm of the paper, and its table of one fit a set."""
