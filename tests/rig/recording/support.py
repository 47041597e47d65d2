"""A motion that is consistent in itself, written in whatever format a test needs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.config.load import load_config
from rig.errors import RecordingError
from rig.recording.load import read_recording
from rig.recording.run import Recording


def motion(count: int = 500) -> dict[str, Any]:
    """Half a second at 1 kHz: angle, its exact rate, and a torque."""
    time_s = np.arange(count) * 1e-3
    return {
        "time_s": time_s,
        "torque_nm": 3 * np.sin(20 * time_s),
        "rate_rad_s": 2 * np.cos(40 * time_s),
        "angle_rad": 0.05 * np.sin(40 * time_s),
    }


def csv_of(columns: Mapping[str, Any], delimiter: str = ",") -> str:
    """Text with a header and every digit of every number."""
    rows = zip(*columns.values(), strict=True)
    lines = [delimiter.join(columns)] + [delimiter.join(repr(float(v)) for v in row) for row in rows]
    return "\n".join(lines) + "\n"


def read(folder: Path, file: str, options: str = "", entry: str = "") -> Recording:
    """What `recorded` makes of one file, with further keys of the section and of the run."""
    yaml = folder / "rig.yaml"
    yaml.write_text(f"backend: recorded\nrecorded:\n{options}  runs:\n    - file: {file}\n{entry}")
    return read_recording(load_config(yaml))


def refusal(folder: Path, file: str, options: str = "", entry: str = "") -> str:
    """The message with which a recording is refused; it names the file and means exit code 2."""
    with pytest.raises(RecordingError) as error:
        read(folder, file, options, entry)
    assert error.value.exit_code == 2
    assert file in str(error.value)
    return str(error.value)
