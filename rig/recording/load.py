"""From the `recorded` section of a configuration to a Recording whose every run has been checked."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import RecordingError
from rig.recording.checks import check_run
from rig.recording.file_faults import FileFaults
from rig.recording.long.files import long_files, shortened
from rig.recording.readers import read_file
from rig.recording.run import Recording, Run, printable
from rig.recording.stated_units import with_factors_in_place
from rig.recording.tables import between, factors_of, run_of_table
from rig.recording.turns import on_one_turn, unwrapped

if TYPE_CHECKING:
    from rig.config.load import LoadedConfig
    from rig.config.recorded import RecordedConfig, RecordedRun


def read_recording(loaded: LoadedConfig) -> Recording:
    """Read and check every run that ``loaded`` names.

    Raises RecordingError that lists what is wrong with every file, each with its cause and cure, and
    ValueError where the configuration has no `recorded` section.
    """
    section = loaded.config.recorded
    if section is None:
        raise ValueError("the configuration has no recorded section")
    runs: list[Run] = []
    own: set[int] = set()  # those that this program played: they are used as they are
    faults = FileFaults()
    sources: list[Path] = []
    long = long_files(section, loaded.folder)
    for i, entry in enumerate(section.runs):
        path = loaded.folder / Path(entry.file)
        try:
            path = _expanded(loaded.folder, entry.file)
            found, is_own = ([long[i].run()], False) if i in long else runs_of_file(path, entry, section)
        except RecordingError as error:
            faults.add(path, str(error))
            continue
        own |= set(range(len(runs), len(runs) + len(found))) if is_own else set()
        runs += found
        sources += [path] * len(found)
    wrong = faults.lines() or _fitted_and_held_out(runs, sources)
    if wrong:
        raise RecordingError("\n".join(wrong))
    runs = on_one_turn(runs)
    runs = shortened(runs, own, section.most_samples)
    info = {"backend": "recorded", "files": [str(path) for path in sources], "config_text": loaded.text}
    return Recording(_with_unique_names(runs), axis=section.axis, noise=section.noise, info=info)


def _expanded(folder: Path, file: str) -> Path:
    try:
        return folder / Path(file).expanduser()
    except RuntimeError as error:
        raise RecordingError(f"{file}: the home folder (~) is unknown ({error}): give the absolute path") from error


def runs_of_file(path: Path, entry: RecordedRun, section: RecordedConfig) -> tuple[list[Run], bool]:
    """The checked runs of one entry: one of a table, as many as were played of our own files; and whether it is ours.

    Raises RecordingError.
    """
    runs: list[Run] = []
    contents = read_file(path)
    for content in contents:
        factors: Mapping[str, float] = {}
        if isinstance(content, Run):
            run = _window(_own_run(path, content, entry, section), entry, path)
        else:
            factors = factors_of(content, section)
            run = run_of_table(content, factors, entry, section)
        try:
            if section.axis == "rotary" and not isinstance(content, Run):
                run = unwrapped(run, path)
            runs.append(check_run(run, path, section.scales_given, section.axis))
        except RecordingError as error:
            raise RecordingError(with_factors_in_place(str(error), factors)) from None
    return runs, any(isinstance(content, Run) for content in contents)


def _own_run(path: Path, run: Run, entry: RecordedRun, section: RecordedConfig) -> Run:
    if section.columns.model_fields_set or section.scales_given:
        raise RecordingError(
            f"{path}: was written by this program, in SI units under its own names: "
            "leave recorded.columns, recorded.scale and recorded.sample_rate_hz out (a further channel of it is "
            "declared in identify.channels)"
        )
    return dataclasses.replace(
        run,
        use=run.use if entry.use == "auto" else entry.use,
        min_rate_rad_s=max(run.min_rate_rad_s, section.min_rate_of(entry)),
        added_inertia_kg_m2=entry.added_inertia_kg_m2 or run.added_inertia_kg_m2,
    )


def _window(run: Run, entry: RecordedRun, path: Path) -> Run:
    """The samples between from_s and to_s, both included."""
    if entry.from_s is None and entry.to_s is None:
        return run
    keep = between(run.time_s, entry, path)
    cut = None
    if run.torque_time_s is not None:
        start = -math.inf if entry.from_s is None else entry.from_s
        end = math.inf if entry.to_s is None else entry.to_s
        cut = (run.torque_time_s >= start) & (run.torque_time_s <= end)
    return dataclasses.replace(
        run,
        time_s=run.time_s[keep],
        valid=run.valid[keep],
        rate_rad_s=None if run.rate_rad_s is None else run.rate_rad_s[keep],
        angle_rad=None if run.angle_rad is None else run.angle_rad[keep],
        torque_time_s=None if cut is None or run.torque_time_s is None else run.torque_time_s[cut],
        torque_nm=None if cut is None or run.torque_nm is None else run.torque_nm[cut],
        channels={name: values[keep] for name, values in run.channels.items()},
    )


def _fitted_and_held_out(runs: Sequence[Run], sources: Sequence[Path]) -> list[str]:
    """Stretches of one file that are both fitted and held out: their error would prove nothing."""
    wrong: list[str] = []
    for i, one in enumerate(runs):
        for j, other in enumerate(runs):
            if one.use != "fit" or other.use != "holdout" or sources[i] != sources[j] or one.name != other.name:
                continue
            start, end = max(one.time_s[0], other.time_s[0]), min(one.time_s[-1], other.time_s[-1])
            if start < end:
                wrong.append(
                    f"{sources[i]}: {start:g} to {end:g} s has both use: fit and use: holdout: set from_s and to_s so "
                    "that the two do not overlap"
                )
    return wrong


def _with_unique_names(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Runs with names of their own, so that a table of them can be read; what steers a terminal is no part of them."""
    runs = [dataclasses.replace(run, name=printable(run.name)) for run in runs]
    names = [run.name for run in runs]
    return tuple(
        run
        if names.count(run.name) == 1
        else dataclasses.replace(run, name=f"{run.name} #{names[:i].count(run.name) + 1}")
        for i, run in enumerate(runs)
    )
