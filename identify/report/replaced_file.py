"""A file that takes the place of an older one only once it is complete."""

from __future__ import annotations

from pathlib import Path


def replace_file(path: Path, content: str | bytes) -> Path:
    """Write a file, UTF-8 where it is text, that replaces an older one only once it is complete; returns ``path``.

    Raises OSError where it cannot be written; nothing is left half written.
    """
    partial = path.with_name(path.name + ".part")
    try:
        partial.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
        partial.replace(path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise
    return path
