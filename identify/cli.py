"""The entry point of `identify-run`: signals first, then what is slow to import."""

from __future__ import annotations

from rig.cli.early import end_quietly


def main() -> None:
    """Entry point of `identify-run`."""
    end_quietly()
    from identify.app import app
    from rig.cli.exits import leave_warnings_to_developers

    leave_warnings_to_developers()
    app(prog_name="identify-run")
