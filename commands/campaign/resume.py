"""`--resume`: plays the sets that a campaign did not finish into a new folder, together with the finished ones."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from commands.campaign.backends import EMULATED, RECORDED, SIMULATED, backend_name
from commands.campaign.campaign_part import CampaignPart, PlayedCampaign
from commands.campaign.context import CommandContext
from commands.campaign.playing import play
from commands.campaign.results_folder import JOURNAL_FILE, ResultsFolder
from commands.campaign.saving import export_earlier
from commands.terminal.display import counted, plain
from rig.config.load import LoadedConfig
from rig.errors import RecordingError, UsageError
from rig.recording.run import Recording, Run

if TYPE_CHECKING:
    from rig.recording.journal_reader import JournalContents

RESUMED_SEED_STEP = 1_000_033  # a simulated gyro must not repeat its noise
# Sections that decide what a set is, by the backend it is played on.
SECTIONS: Mapping[str, tuple[str, ...]] = {
    SIMULATED: ("excitation", "simulated"),
    "bench": ("excitation", "bench"),
    EMULATED: ("excitation", "bench", "simulated"),
}
# With scale_to_limits these decide how large a set is.
SCALING = ("model", "limits")
# What may change from one day to the next without making the sets incomparable.
MAY_DIFFER = (
    "simulated.seed", "excitation.rest_s",
    "bench.gyroscope.port", "bench.amplifier.can.channel", "bench.amplifier.can.tty_baud",
    "bench.real_time", "bench.raw_capture", "bench.replay", "bench.settle_s", "bench.emulator.faults",
)  # fmt: skip


@dataclass(frozen=True)
class UnfinishedCampaign:
    """What a results folder holds of a campaign: its journals, the runs that are whole, what was planned."""

    folder: Path
    journals: tuple[Path, ...]
    runs: tuple[Run, ...]
    planned: tuple[str, ...]
    header: Mapping[str, Any]

    @property
    def done(self) -> frozenset[str]:
        """Names of the sets that are finished."""
        return frozenset(run.name for run in self.runs)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the sets that are not."""
        return tuple(name for name in self.planned if name not in self.done)


def play_campaign(context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder) -> PlayedCampaign:
    """Play the campaign, or with --resume what is missing of it; raises what ``play`` raises."""
    if context.options.resume is None:
        return play(context, loaded, folder)
    backend = backend_name(loaded.config, context.options.dry_run, context.options.emulate)
    if backend == RECORDED:
        raise UsageError("--resume: recordings are read, not played: there is nothing to resume.")
    before = read_unfinished(context.options.resume)
    refuse_differences(before, loaded, backend)
    summary = (
        f"Resuming {plain(str(before.folder))}: {len(before.done)} of {counted(len(before.planned), 'set')} finished"
    )
    names = tuple(f"earlier_{number}.journal" for number in range(1, len(before.journals) + 1))
    earlier = PlayedCampaign(Recording(before.runs), before.done, None, names)
    copies = tuple(zip(before.journals, names, strict=True))
    part = CampaignPart(earlier=earlier, copied_journals=copies, resumes=before.folder)
    if not before.missing:
        context.terminal.show(f"{summary}; nothing is left to play.")
        return export_earlier(context, loaded, folder, part, before.header)
    context.terminal.show(f"{summary}; to play: {plain(', '.join(before.missing))}.")
    return play(context, _with_another_seed(loaded, len(before.journals)), folder, part)


def _with_another_seed(loaded: LoadedConfig, number: int) -> LoadedConfig:
    simulated = loaded.config.simulated
    seed = (simulated.seed + number * RESUMED_SEED_STEP) % 2**32
    config = loaded.config.model_copy(update={"simulated": simulated.model_copy(update={"seed": seed})})
    return replace(loaded, config=config)


def read_unfinished(folder: Path) -> UnfinishedCampaign:
    """What there is in a results folder. Raises RecordingError where it holds no journal that can be read."""
    from rig.recording.journal_reader import read_journal
    from rig.recording.results import campaign_journals

    if not folder.is_dir():
        raise RecordingError(f"--resume {folder}: is not a folder: give the results folder of the campaign to resume")
    journals = campaign_journals(folder)
    if not journals:
        raise RecordingError(f"--resume {folder}: holds no {JOURNAL_FILE}: play the campaign again without --resume")
    contents = [read_journal(path) for path in journals]
    header = contents[-1].header
    planned, config = header.get("planned_in_all", header.get("planned")), header.get("config")
    if not isinstance(planned, list) or not isinstance(config, dict):
        raise RecordingError(
            f"--resume {folder}: its journal was written by an earlier version and does not list the planned "
            "sets: play the campaign again without --resume"
        )
    runs = {run.name: run for part in contents for run in _whole(part)}
    return UnfinishedCampaign(
        folder, tuple(journals), tuple(runs.values()), tuple(str(name) for name in planned), header
    )


def _whole(contents: JournalContents) -> Iterator[Run]:
    from rig.recording.journal_reader import run_from_journal

    for source in contents.runs:
        if source.complete and len(source.tables["samples"]) > 1:
            yield run_from_journal(source)


def refuse_differences(before: UnfinishedCampaign, loaded: LoadedConfig, backend: str) -> None:
    """Raise UsageError that names every key by which the sets would not belong together."""
    was = before.header.get("played_on")
    if was != backend:
        raise UsageError(
            f"--resume {before.folder}: was played on the {was} backend and would continue on the {backend} backend: "
            "resume with the same backend and options"
        )
    then = before.header["config"]
    now = json.loads(json.dumps(loaded.config.model_dump(mode="json"), default=str))
    sections = SECTIONS[backend] + (SCALING if loaded.config.excitation.scale_to_limits else ())
    wrong = [line for section in sections for line in _differences(then.get(section), now.get(section), (section,))]
    if wrong:
        raise UsageError(
            f"--resume {before.folder}: old and new sets could not be fitted together, because these keys differ:\n"
            + "\n".join(f"  {line}" for line in wrong)
            + "\nRestore these values, or play the whole campaign again."
        )


def _differences(then: Any, now: Any, path: Sequence[str]) -> Iterator[str]:
    key = ".".join(path)
    if any(key == name or key.startswith(f"{name}.") for name in MAY_DIFFER) or then == now:
        return
    if isinstance(then, dict) and isinstance(now, dict):
        for name in now:
            if name in then:  # a key that the earlier version did not know has its default
                yield from _differences(then[name], now[name], (*path, name))
        yield from (f"{key}.{name}: was {_short(then[name])}, is no longer set" for name in then if name not in now)
    elif isinstance(then, list) and isinstance(now, list) and len(then) == len(now):
        for i, (one, other) in enumerate(zip(then, now, strict=True)):
            yield from _differences(one, other, (*path, str(i)))
    else:
        yield f"{key}: was {_short(then)}, is {_short(now)}"


def _short(value: Any) -> str:
    text = plain(json.dumps(value))
    return text if len(text) <= 60 else f"{text[:57]}..."
