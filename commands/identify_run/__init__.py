"""The entry point of `identify-run`: signals first, then what is slow to import."""

from __future__ import annotations

from commands.terminal.early_signals import end_quietly


def main() -> None:
    """Entry point of `identify-run`."""
    end_quietly()
    from commands.identify_run.app import app
    from commands.terminal.exit_codes import leave_warnings_to_developers

    leave_warnings_to_developers()
    app(prog_name="identify-run")
