"""The command `rig`, and what it shares with `identify-run`: the top floor, which only wires things together.

What is heavy (numba, h5py, the drivers) is imported where it is used, so that help, a wrong option and a
wrong file are answered at once.
"""

from __future__ import annotations


def main() -> None:
    """Entry point of `rig`."""
    from commands.terminal.early_signals import end_on_signals

    end_on_signals()
    from commands.rig.app import app
    from commands.terminal.exit_codes import hide_library_warnings

    hide_library_warnings()
    app(prog_name="rig")
