"""A place for the compiled kernels where neither the installation nor the home folder can be written.

Numba keeps what it has compiled beside the source, or else in the user's cache folder, and refuses to start
where it can write to neither. What it finds there it runs, so a folder that others may write is no place.
"""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"


def ensure_compiled_cache(package: Path | None = None) -> None:
    """Set NUMBA_CACHE_DIR where it is needed. Has to come before numba is imported."""
    if os.environ.get(VARIABLE):
        return
    source = package or Path(__file__).parent
    if "site-packages" in source.parts:
        # Files that pip did not put there outlive an uninstall, and the folders that they keep alive would
        # hide the package when it is installed anew from a source tree.
        if _can_write(_user_cache()):
            os.environ[VARIABLE] = str(_user_cache())
            return
    elif _can_write(source / "__pycache__") or _can_write(_user_cache()):
        return
    os.environ[VARIABLE] = str(_own_folder())


def _user_cache() -> Path:
    base = os.environ.get("LOCALAPPDATA") if os.name == "nt" else os.environ.get("XDG_CACHE_HOME")
    with contextlib.suppress(RuntimeError):  # no home folder at all
        return Path(base) / "numba" if base else Path.home() / ".cache" / "numba"
    return Path(os.sep) / "nonexistent"


def _can_write(folder: Path) -> bool:
    """Whether ``folder`` is there to be written, or can be made."""
    for place in (folder, *folder.parents):
        if place.exists():
            return place.is_dir() and os.access(place, os.W_OK | os.X_OK)
    return False


def _own_folder() -> Path:
    """A folder under the system's temporary one that nobody else can write."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    import tempfile  # noqa: PLC0415  every command waits for this module, and hardly one needs that one

    folder = Path(tempfile.gettempdir()) / f"isp-rig-compiled-{user}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        is_private = stat.S_ISDIR(found.st_mode) and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if is_private and (not hasattr(os, "getuid") or found.st_uid == os.getuid()):
            return folder
    return Path(tempfile.mkdtemp(prefix="isp-rig-compiled-"))
