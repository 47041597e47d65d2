"""Playing a campaign from the command line, shared by `rig play` and `identify-run`."""
