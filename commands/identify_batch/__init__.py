"""The entry point of `identify-batch`: signals first, then what is slow to import."""

from __future__ import annotations

from commands.terminal.early_signals import end_on_signals


def main() -> None:
    """Entry point of `identify-batch`."""
    end_on_signals()
    from commands.identify_batch.app import app
    from commands.terminal.exit_codes import hide_library_warnings

    hide_library_warnings()
    app(prog_name="identify-batch")
