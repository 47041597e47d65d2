"""Between a command and whoever sits at the terminal: options, signals, display, exit codes."""
