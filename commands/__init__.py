"""The commands: the top layer, which connects the other packages."""
