"""`rig prove`: plays the proof of a results folder, on the rig that made it or as a rehearsal on another."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from commands.campaign.backends import backend_name
from commands.campaign.campaign_part import PlayedCampaign
from commands.campaign.context import CommandContext
from commands.campaign.results_folder import ResultsFolder
from commands.identification.proof import ProofPart, prove, why_no_proof
from commands.identification.results import conclude
from commands.terminal.exit_codes import NOT_ACCEPTED, OK, exit_code_of
from rig.errors import RecordingError, UsageError
from rig.recording.results import journals_of

if TYPE_CHECKING:
    from identify.proven import Proof
    from identify.results import Identification
    from rig.config.load import LoadedConfig
    from rig.recording.run import Recording


PROOF_FILES = "proof"  # what the names of its journals begin with


def prove_folder(context: CommandContext, folder: Path, rival: str | None) -> int:
    """Play the proof of what a results folder found; returns the exit code. Raises UsageError."""
    found, recording, identified_runs = _read(folder)
    if found.aborted and _has_proof(folder):  # a proof was cut short: of a search that was, none is played
        found = dataclasses.replace(found, aborted=False)
    why = why_no_proof(found)
    if why:
        raise UsageError(f"{folder}: nothing to prove: {why}. Nothing was moved.")
    loaded = _config_of(folder, recording, context.options.seed)
    backend = backend_name(loaded.config, context.options.dry_run, context.options.emulate)
    before = recording.info.get("played_on")
    if backend != before:
        return _rehearsed(context, folder, loaded, found, recording, rival, f"{before or 'recorded'} backend")
    journals = tuple(path.name for path in journals_of(folder))
    if not journals:
        raise RecordingError(
            f"{folder}: holds no .journal, to which the runs of a proof are added: restore it from a copy"
        )
    names = frozenset(run.name for run in recording.runs)
    existing = ExistingFolder(folder)
    context.folder = existing
    first = 1 + sum(name.startswith(PROOF_FILES) for name in journals)
    earlier = PlayedCampaign(recording, names, None, journals)
    proved = prove(context, loaded, existing, earlier, found, rival, first=first)
    runs = proved.recording.runs
    if proved.found.proof is found.proof or {run.name for run in runs} == names:
        runs = tuple(run for run in runs if run.name in identified_runs)
    shown = dataclasses.replace(proved.recording, runs=runs)
    conclude(context, proved.loaded, existing, shown, proved.found)
    if proved.played.cause is not None:
        return exit_code_of(proved.played.cause)
    return _code(proved.found.proof)


def _has_proof(folder: Path) -> bool:
    return any(path.name.startswith(PROOF_FILES) for path in journals_of(folder))


def _code(proof: Proof | None) -> int:
    """0 where all names are confirmed but those that by the model are too small to be seen beside the others."""
    from identify.proof.plan import REFUTED

    if proof is None:
        return NOT_ACCEPTED
    several = proof.effects.values()
    judged = [one for one in several if not (one.status == "cannot be told" and one.announced_left > REFUTED)]
    return OK if judged and all(one.status == "confirmed" for one in judged) else NOT_ACCEPTED


class ExistingFolder(ResultsFolder):
    """A results folder that is there and is added to."""

    def __init__(self, path: Path) -> None:
        self.path, self.is_created = path, True

    def discard(self) -> None:
        """It stays: others made it."""


def _read(folder: Path) -> tuple[Identification, Recording, frozenset[str]]:
    """What was found, all runs, and the names of those that it was found from. Raises RecordingError."""
    from identify.report.report_data import FILE, read_report_data
    from rig import effects
    from rig.recording.hdf5 import read_recording_h5
    from rig.recording.results import RECORDING_FILE

    if not folder.is_dir():
        raise RecordingError(f"{folder}: is not a folder: give the results folder of an identify-run")
    for file, cure in ((FILE, "identify from its recording first"), (RECORDING_FILE, "run `rig recover` on it first")):
        if not (folder / file).is_file():
            raise RecordingError(f"{folder}: has no {file}: {cure}. Nothing was moved.")
    data = read_report_data(folder / FILE)
    if data.own_effects and any(name in data.own_effects for name in _effects_of(data.identification)):
        raise UsageError(
            f"{folder}: its model has effects of your own, and code that a results folder names is not run: set "
            "identify.prove in the rig.yaml that names them, and play it again. Nothing was moved."
        )
    effects.declare_channels(data.channels)
    return data.identification, read_recording_h5(folder / RECORDING_FILE), frozenset(data.runs)


def _effects_of(found: Identification) -> tuple[str, ...]:
    model = found.final.platform
    return tuple(model.effects) if model is not None else ()


def _config_of(folder: Path, recording: Recording, seed: int | None) -> LoadedConfig:
    """The configuration that the recording quotes. Raises UsageError where it quotes none."""
    from rig.config.load import LoadedConfig, config_as_recorded

    info = recording.info
    text = info.get("config_text")
    if not isinstance(text, str):
        raise RecordingError(f"{folder}: its recording does not contain a configuration. Nothing was moved.")
    source = Path(str(info.get("config_file", "rig.yaml")))
    included = {str(k): str(v) for k, v in dict(info.get("config_included") or {}).items()}
    overrides = [str(one) for one in info.get("config_overrides") or ()]
    more = [] if seed is None else [f"simulated.seed={seed}"]
    config = config_as_recorded(text, source, overrides, included, more)
    return LoadedConfig(config, text, source, (*overrides, *more), included)


def _rehearsed(
    context: CommandContext, folder: Path, loaded: LoadedConfig, found: Identification, recording: Recording,
    rival: str | None, was: str,
) -> int:  # fmt: skip
    """Play the proof on another backend than the recording's: into a folder of its own, for the two do not mix."""
    from commands.campaign.proof import play_proof
    from identify.proof.drive import resolution_of
    from identify.proof.rivals import rival_models
    from identify.proof.verdict import judge
    from identify.proof.wording import lines
    from rig.recording.results import free_name

    model: Any = found.final.platform
    angle = bool(found.traces) and found.traces[0].channel == "angle"
    rivals = rival_models(found, rival) if rival is not None else {}
    noise = found.noise_floor.holdout_rate_rms
    part = ProofPart(model, rivals, angle, resolution_of(recording), recorded=recording.runs, noise=noise)
    context.folder = ResultsFolder(free_name(folder, "rehearsal"), loaded.config.name, _now())
    context.terminal.show(
        f"A rehearsal: the recording is of the {was}, so nothing of {folder} is changed; the runs go to a folder of "
        "their own in it."
    )
    played = play_proof(context, loaded, context.folder, None, part)
    if played.cause is not None:
        return exit_code_of(played.cause)
    assert part.plan is not None
    proof = judge(part.plan, played.recording, model)
    context.terminal.flush()
    sys.stdout.write("".join(f"{line}\n" for line in lines(proof)) + f"\nRecording: {context.folder.path}\n")
    return _code(proof)


def _now() -> Any:
    from datetime import UTC, datetime

    return datetime.now(UTC)
