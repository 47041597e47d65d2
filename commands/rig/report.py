"""`rig report`: makes report.html of a results folder again."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from commands.terminal.display import plain
from commands.terminal.exit_codes import OK, say
from rig.errors import RecordingError


def rebuild(folder: Path, effect_files: Sequence[Path]) -> int:
    """Write the report anew and say where it is; returns the exit code. Raises UsageError."""
    if not folder.is_dir():
        what = "is not a folder" if folder.exists() else "there is no such folder"
        raise RecordingError(f"{folder}: {what}: give the results folder of an identify-run")
    for file in effect_files:
        say(f"runs code: {file.resolve()} (named by --effects)")
    from identify.report.rebuild import rebuild_report

    sys.stdout.write(f"Report: {plain(str(rebuild_report(folder, effect_files)))}\n")
    return OK
