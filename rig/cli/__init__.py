"""The command `rig`, and what it shares with `identify-run`: the top floor, which only wires things together.

What is heavy (numba, h5py, the drivers) is imported where it is used, so that help, a wrong option and a
wrong file are answered at once.
"""

from __future__ import annotations


def main() -> None:
    """Entry point of `rig`."""
    from rig.cli.early import end_quietly

    end_quietly()
    from rig.cli.app import app
    from rig.cli.exits import leave_warnings_to_developers

    leave_warnings_to_developers()
    app(prog_name="rig")
