"""The terminal: options, signals, display, exit codes."""
