"""`rig recover`: what a kill or a power cut left of a results folder, mended, said, and made ready to identify from."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from rig.cli.exits import OK
from rig.cli.terminal import plain
from rig.errors import RecordingError

CONFIG_FILE = "recovered.yaml"
CAPTURE_FILE = "wire.cap"
RESULT_FILE = "result.json"


def recover_folder(folder: Path) -> int:
    """Mend ``folder`` and say on stdout what was found; returns the exit code. Raises RecordingError."""
    from rig.recording.recover import recover

    if not folder.is_dir():
        raise RecordingError(f"{folder}: is no folder: give the results folder of a campaign")
    captured = list(_captures(folder))
    for line in captured:
        sys.stdout.write(plain(line) + "\n")
    try:
        recovery = recover(folder)
    except RecordingError as error:
        if not captured:
            raise
        raise RecordingError(
            f"{error}; its raw capture can still be played through the drivers: rig play CONFIG --set "
            f"bench.replay={folder.resolve()}, with the configuration of then"
        ) from None
    for line in recovery.lines:
        sys.stdout.write(plain(line) + "\n")
    if not (folder / RESULT_FILE).exists():
        sys.stdout.write(f"{RESULT_FILE}: absent: nothing was identified before it ended\n")
    if not recovery.is_new:
        sys.stdout.write(f"Nothing had to be recovered: {plain(str(recovery.export))} has everything.\n")
        return OK
    config = _write_config(folder, recovery.export, recovery.recording.info)
    sys.stdout.write(
        f"Recovered: {plain(str(recovery.export))}\nTo identify from it: identify-run {plain(str(config))}\n"
    )
    return OK


def _captures(folder: Path) -> Iterator[str]:
    """A line for every raw capture; what a campaign writes beside it at its end is written where it is missing."""
    from drivers.capture_account import account_of, export_if_missing

    for path in sorted(folder.glob(f"raw/**/{CAPTURE_FILE}")):
        name = path.relative_to(folder)
        try:
            account = account_of(path)
        except RecordingError as error:
            yield f"{name}: lost: {error}"
            continue
        yield f"{name}: {account}"
        for written in export_if_missing(path, account):
            yield f"{written.relative_to(folder)}: written"


def _write_config(folder: Path, export: Path, info: Mapping[str, Any]) -> Path:
    """A configuration that reads what was recovered, with the model that was declared."""
    from rig.recording.results import free_name

    content: dict[str, Any] = {"backend": "recorded", "recorded": {"runs": [{"file": export.name}]}}
    config = info.get("config")
    model = config.get("model") if isinstance(config, dict) else None
    head = "# What was recovered here, and the model that was declared.\n"
    if isinstance(model, dict):
        content["model"] = dict(model)
        if content["model"].pop("effects_from", None):
            # A recording comes from anywhere; a file of effects is code, and only a person may name that.
            content["model"].pop("effects", None)
            head += "# It had effects of its own: name their file under model.effects_from again if you trust it.\n"
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
    path = free_name(folder, CONFIG_FILE)
    path.write_text(head + text, encoding="utf-8")
    return path
