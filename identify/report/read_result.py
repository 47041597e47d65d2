"""result.json of a results folder, read back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rig.errors import RecordingError

RESULT = "result.json"


def read_result(path: Path) -> dict[str, Any]:
    """result.json. Raises RecordingError where it cannot be read or is no JSON."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    except RecursionError:
        raise RecordingError(f"{path}: is damaged (nested too deeply): restore it from a copy") from None
    except ValueError as error:  # JSON, or bytes that are no text
        raise RecordingError(f"{path}: is damaged ({error}): restore it from a copy, or identify again") from error
    if not isinstance(found, dict):
        raise RecordingError(f"{path}: holds {type(found).__name__} and no result: restore it from a copy")
    return found
