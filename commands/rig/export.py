"""`rig export` for other programs: a recording with a rig.yaml that reads it, the CAN log, a model, a compensation."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from commands.rig.recover import CAPTURE_FILE
from commands.terminal.display import plain
from commands.terminal.exit_codes import OK, say
from identify.report import model_formats
from rig.errors import RecordingError, UsageError
from rig.recording import writers
from rig.recording.run import Run

if TYPE_CHECKING:
    from identify.results import Identification
    from rig.recording.run import Recording

CAN_FORMATS = ("blf", "asc", "mf4")
COMPENSATION = "compensation"
FORMATS = (*writers.names(), *CAN_FORMATS, *model_formats.names(), COMPENSATION)
IN_ITS_LANGUAGE = ("c", "python", "table")  # what people type for it: all of its files are written
CONFIG_FILE = "rig.yaml"


def export_recording(source: Path, wanted: str, out: Path | None, effect_files: Sequence[Path] = ()) -> int:
    """Write ``source`` (a results folder, a recording.h5, a journal) as ``wanted``; returns the exit code.

    ``effect_files`` are those of effects of your own: run for a model or a compensation, copied beside a rig.yaml that
    names them.

    Raises UsageError where it cannot be done; nothing is overwritten.
    """
    if wanted.lower() in IN_ITS_LANGUAGE:
        wanted = COMPENSATION
    if wanted not in FORMATS:
        raise UsageError(f"--to {wanted[:40]} is not a known format: choose one of {', '.join(FORMATS)}")
    _check_files(effect_files)
    home = source if source.is_dir() else source.parent
    folder = out if out is not None else home / f"export_{wanted}"
    if folder.exists() or folder.is_symlink():
        raise UsageError(f"{folder} exists and is never overwritten: choose another --out")
    if wanted == COMPENSATION:
        lines = list(_compensation(home, folder, effect_files))
    elif wanted in model_formats.names():
        lines = list(_model(home, wanted, folder, effect_files))
    elif wanted in CAN_FORMATS:
        lines = list(_can_logs(home, wanted, folder))
    else:
        lines = list(_runs(source, wanted, folder, effect_files))
    sys.stdout.writelines(f"{plain(line)}\n" for line in lines)
    return OK


def _made(folder: Path) -> None:
    try:
        folder.mkdir(parents=True)
    except OSError as problem:
        raise UsageError(f"cannot make {folder}: {problem.strerror}: choose another --out") from None


def _check_files(effect_files: Sequence[Path]) -> None:
    for file in effect_files:
        if not file.is_file():
            raise UsageError(f"--effects {file}: no such file: correct the path")
        if file.suffix != ".py" or [other.name for other in effect_files].count(file.name) > 1:
            raise UsageError(f"--effects {file}: give each file of effects a name of its own that ends in .py")


def _can_logs(home: Path, wanted: str, folder: Path) -> Iterator[str]:
    from drivers.capture.can_export import check_installed, write_can_log

    check_installed(wanted)
    captures = sorted(home.glob(f"raw/**/{CAPTURE_FILE}"))
    if not captures:
        raise RecordingError(f"{home}: has no raw/{CAPTURE_FILE}: only a bench run has a CAN log")
    _made(folder)
    for capture in captures:
        part = capture.parent.name if capture.parent != home / "raw" else "can"
        target = folder / f"{part}.{wanted}"
        yield f"{target}: {write_can_log(capture, target)} frames of {capture}; the first frame is at time 0"


def _compensation(home: Path, folder: Path, effect_files: Sequence[Path]) -> Iterator[str]:
    """The torque that cancels the effects of the final model, as a function of angle, rate and torque."""
    from identify.proof.controller import controller_of
    from identify.proof.controller_code import files

    found, recording = _identified(home, effect_files)
    model = found.final.platform
    if model is None or found.torque_free:
        raise UsageError(f"{home}: its identification gave no model from which a torque can be computed")
    most_nm = _most_torque_nm(recording.info)
    made = files(controller_of(model, recording, most_nm))
    _made(folder)
    for name, text in made.items():
        (folder / name).write_text(text, encoding="ascii")
        yield f"{folder / name}: written"


def _model(home: Path, wanted: str, folder: Path, effect_files: Sequence[Path]) -> Iterator[str]:
    """The final model, every effect with its equation."""
    from identify.report.model_formats.description import described

    found, recording = _identified(home, effect_files)
    model = described(found, recording, _inertia_of(home) if found.torque_free else None)
    content = model_formats.content_of(wanted, model)
    _made(folder)
    target = folder / model_formats.file_of(wanted)
    target.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
    yield f"{target}: written"
    if not model.accepted:
        yield f"NOT ACCEPTED: read {home / 'report.html'} before you use this model"


def _inertia_of(home: Path) -> float | None:
    """The inertia that set the scale of a recording without torque; None where model.yaml says that none did."""
    try:
        model = yaml.safe_load((home / "model.yaml").read_text(encoding="utf-8"))
        return None if model.get("inertia_unknown") else float(model["inertia_kg_m2"])
    except (OSError, yaml.YAMLError, AttributeError, KeyError, TypeError, ValueError):
        return None  # ratios to the inertia are right in any case


def _identified(home: Path, effect_files: Sequence[Path]) -> tuple[Identification, Recording]:
    """What was identified in a results folder, all of its effects known, and from what."""
    from identify.report.own_effects import make_effects_known
    from identify.report.report_data import FILE, read_report_data
    from rig.recording.hdf5 import read_recording_h5
    from rig.recording.results import RECORDING_FILE

    for name in (FILE, RECORDING_FILE):
        if not (home / name).is_file():
            raise RecordingError(f"{home}: has no {name}: give the results folder of an identify-run")
    data = read_report_data(home / FILE)
    for file in effect_files:
        say(f"runs code: {file.resolve()} (named by --effects)")
    make_effects_known(data, effect_files)
    return data.identification, read_recording_h5(home / RECORDING_FILE)


def _most_torque_nm(info: Mapping[str, Any]) -> float:
    """The torque limit of the rig that was recorded; the default of a rig.yaml where the recording quotes none."""
    from rig.config.limits import LimitsConfig

    config = info.get("config")
    limits = config.get("limits") if isinstance(config, dict) else None
    given = limits.get("torque_nm") if isinstance(limits, dict) else None
    return float(given) if isinstance(given, int | float) else LimitsConfig().torque_nm


def _runs(source: Path, wanted: str, folder: Path, effect_files: Sequence[Path]) -> Iterator[str]:
    from rig.recording.readers import read_file
    from rig.recording.writers.columns import columns_of

    runs = [content for content in read_file(source) if isinstance(content, Run)]
    if not runs:
        raise RecordingError(f"{source}: is already a table, not a recording of this program: use it directly")
    _made(folder)
    write = writers.writer_of(wanted)
    entries: list[dict[str, Any]] = []
    for number, run in enumerate(runs, 1):
        name = writers.file_name(number, run.name, wanted)
        write(folder / name, columns_of(run))
        entries.append(_entry(run, name))
        yield f"{folder / name}: {len(run.time_s)} samples"
    config: dict[str, Any] = {
        "backend": "recorded", "recorded": {"torque_hold": runs[0].torque_hold, "runs": entries}
    }  # fmt: skip
    for file in effect_files:
        (folder / file.name).write_bytes(file.read_bytes())
        config.setdefault("model", {}).setdefault("effects_from", []).append(file.name)
        yield f"{folder / file.name}: effects of your own, which {CONFIG_FILE} names"
    text = yaml.safe_dump(config, sort_keys=False, default_flow_style=None)
    (folder / CONFIG_FILE).write_text(
        f"# Reads the recording that was exported to this folder.\n{text}", encoding="utf-8"
    )
    yield f"{folder / CONFIG_FILE}: the configuration that reads them"
    if not effect_files:
        yield from _without_their_effects(source if source.is_dir() else source.parent)


def _without_their_effects(home: Path) -> Iterator[str]:
    """A line where the model found in these runs has effects that the exported configuration does not know."""
    from identify.report.own_effects import option_for, own_effects_in
    from identify.report.report_data import FILE, read_report_data

    if not (home / FILE).is_file():
        return
    try:
        data = read_report_data(home / FILE)
    except UsageError:  # the runs are exported all the same
        return
    if own := own_effects_in(data):
        yield (
            f"{CONFIG_FILE} does not name your own effects ({', '.join(own)}), which the model found here has: to take "
            f"their file along, export again with {option_for(data, own)}"
        )


def _entry(run: Run, name: str) -> dict[str, Any]:
    entry: dict[str, Any] = {"file": name}
    if run.use != "auto":
        entry["use"] = run.use
    if run.min_rate_rad_s:
        entry["min_rate_rad_s"] = run.min_rate_rad_s
    if run.added_inertia_kg_m2:
        entry["added_inertia_kg_m2"] = run.added_inertia_kg_m2
    return entry
