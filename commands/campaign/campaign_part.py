"""The outcome of a campaign or of a part of one: shared by playing, follow-up and resuming."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from commands.campaign.consent import ask_consent
from commands.campaign.results_folder import JOURNAL_FILE, RAW_FOLDER
from rig.config.load import LoadedConfig
from rig.excitation import PlannedSet
from rig.interface import Rig, Statement
from rig.recording.run import Recording
from rig.recording.tail_file import tail_of


@dataclass(frozen=True)
class PlayedCampaign:
    """What came of a campaign.

    Parameters
    ----------
    recording
        All runs, the last one perhaps cut short; ``info`` says how they came about.
    completed
        The names of the runs that came to their end.
    cause
        What ended the campaign early, or None.
    journals
        The raw journals of its parts in the results folder, in the order they were played.
    rate_full_scale_rad_s
        The largest rate that the gyro reports, or None.
    read_back
        False where the journal could not be read when the campaign was over.
    """

    recording: Recording
    completed: frozenset[str]
    cause: BaseException | None
    journals: tuple[str, ...] = (JOURNAL_FILE,)
    rate_full_scale_rad_s: float | None = None
    read_back: bool = True

    @property
    def complete_runs(self) -> Recording:
        """The whole runs: a run that was cut short may end in the fault that cut it."""
        runs = tuple(run for run in self.recording.runs if run.name in self.completed)
        return dataclasses.replace(self.recording, runs=runs)


@dataclass(frozen=True)
class CampaignPart:
    """One part of a campaign: what its files are called, what stands in the folder already, who is asked.

    ``earlier`` is what was played before: into the same folder, where its recording is kept and added to, or into
    the one that this part ``resumes``; then its journals are ``copied_journals``, each under its new name.

    ``plan`` makes the sets to play, where they are not those of the configuration; it may refuse with UsageError. After
    it ``rest_s`` says how long the rests between them have to be, where not as in the configuration.
    ``listed`` is where in the information of a recording stands what is said of this part; ``then`` is what follows it.
    """

    journal: str = JOURNAL_FILE
    raw: str = RAW_FOLDER
    earlier: PlayedCampaign | None = None
    consent: Callable[[Statement, bool, bool, Callable[[str], str]], None] = ask_consent
    copied_journals: tuple[tuple[Path, str], ...] = ()
    resumes: Path | None = None
    plan: Callable[[Rig, LoadedConfig], tuple[PlannedSet, ...]] | None = None
    rest_s: Callable[[], float | None] = lambda: None
    listed: str = "follow_ups"
    then: str = "the identification"

    @property
    def done(self) -> frozenset[str]:
        """Names of the sets that are not played again."""
        return self.earlier.completed if self.earlier is not None and self.resumes is not None else frozenset()

    def copy_journals(self, path: Path) -> None:
        """Copy what was played before into the folder of this part. Raises OSError."""
        for source, name in self.copied_journals:
            shutil.copyfile(source, path / name)
            if tail_of(source).is_file():
                shutil.copyfile(tail_of(source), tail_of(path / name), follow_symlinks=False)


WHOLE_CAMPAIGN = CampaignPart()
