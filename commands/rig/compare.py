"""`rig compare`: two results folders side by side."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from commands.terminal.exit_codes import OK
from rig.errors import UsageError


def compare_folders(a: Path, b: Path, out: Path | None) -> int:
    """Print what changed from A to B, write it to ``out`` too; returns the exit code. Raises UsageError."""
    if out is not None and (out.exists() or out.is_symlink()):
        raise UsageError(f"--out {out} exists and is never overwritten: choose another file.")
    from identify.report.comparison import TEXT_WIDTH, compare, comparison_html, comparison_text, read_saved
    from identify.report.replaced_file import replace_file

    names = str(a), str(b)
    sections = compare(read_saved(a), read_saved(b), names)
    if out is not None:
        try:
            replace_file(out, comparison_html(sections, names))
        except OSError as error:
            raise UsageError(f"cannot write --out {out}: {error.strerror}. Choose another file.") from error
    is_terminal = sys.stdout.isatty()
    width = shutil.get_terminal_size().columns if is_terminal else TEXT_WIDTH
    sys.stdout.write(comparison_text(sections, width, is_terminal))
    return OK
