"""The commands: the top floor, which only wires the rest together."""
