"""The proof of what was named: played on the rig, judged, and the search run again without what was refuted."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

from commands.campaign.consent import Consent, ask_consent
from commands.campaign.context import CommandContext
from commands.campaign.proof import ProofPart, play_proof
from commands.identification.results import identified, write
from rig.errors import Aborted, UsageError

if TYPE_CHECKING:
    from commands.campaign.campaign_part import PlayedCampaign
    from commands.campaign.results_folder import ResultsFolder
    from identify.results import Identification
    from rig.config.load import LoadedConfig
    from rig.recording.run import Recording

MAX_PROOFS = 2  # of a campaign: the names, and those that came in the place of refuted ones


@dataclass(frozen=True)
class Proved:
    """A campaign with its proof: ``recording`` is what ``found`` was identified from."""

    loaded: LoadedConfig
    played: PlayedCampaign
    found: Identification
    recording: Recording


def why_no_proof(found: Identification) -> str:
    """Why nothing can be proved of an identification; empty where something can."""
    from identify.proof.compensation import cancelled

    model = found.final.platform
    if model is None:
        return "the identification gave no model"
    if found.aborted:
        return "the identification was stopped before its end: identify again from the recording first"
    if found.torque_free:
        return (
            "no torque was recorded, so only ratios to the inertia are known and no compensating torque can be computed"
        )
    if found.axis == "linear":
        return "the rig turns, and this model is that of a linear axis"
    if not cancelled(model):
        return "the final model has no effect that a torque cancels"
    return ""


def prove(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, played: PlayedCampaign,
    found: Identification, rival: str | None = None, consent: Consent = ask_consent, first: int = 1,
) -> Proved:  # fmt: skip
    """Play the proof of ``found`` and judge it; where a name is refuted, identify again without it and prove that.

    What stood before a proof stands whatever it ends in: results are written before anything moves. ``first`` numbers
    the proof among those of its folder.

    Raises
    ------
    UsageError
        Where the first proof may not be played; nothing was moved.
    """
    now = Proved(loaded, played, found, played.recording)
    for number in range(first, first + MAX_PROOFS):
        if number > first and why_no_proof(now.found):
            break
        part = _part(now, rival if number == first else None, number)
        try:
            more = play_proof(context, now.loaded, folder, now.played, part, consent)
        except UsageError:
            if number == first:
                raise
            break
        now = _judged(now, more, part)
        if more.cause is not None or now.found.proof is None:
            break
        refuted = refuted_names(now.found)
        if not refuted:
            break
        write(context, now.loaded, folder, now.recording, now.found)
        again = _identified_without(context, now, refuted)
        if again is None:
            break
        now = again
    return now


def _part(now: Proved, rival: str | None, number: int) -> ProofPart:
    from identify.proof.drive import resolution_of
    from identify.proof.rivals import rival_models

    model = now.found.final.platform
    assert model is not None  # why_no_proof was asked
    traces = now.found.traces
    angle = bool(traces) and traces[0].channel == "angle"
    rivals = rival_models(now.found, rival) if rival is not None else {}
    noise = now.found.noise_floor.holdout_rate_rms
    recorded = now.played.recording
    return ProofPart(model, rivals, angle, resolution_of(recorded), number, recorded.runs, noise)


def _judged(now: Proved, more: PlayedCampaign, part: ProofPart) -> Proved:
    """With what the runs say; a proof that was cut short is judged by its complete sets, or not at all.

    The verdict of an earlier proof that came to its end is not given away for that of one that did not.
    """
    from identify.proof.verdict import judge

    found, info = now.found, more.recording.info
    told = found.proof is not None and bool(found.proof.effects)
    if part.plan is not None and not (told and more.cause is not None):
        try:
            proof = judge(part.plan, more.complete_runs, part.model)
            if found.proof is not None:
                proof = dataclasses.replace(proof, excluded=found.proof.excluded, earlier=found.proof.earlier)
            found = dataclasses.replace(found, proof=proof)
        except ValueError:
            pass  # no set is complete; what ended it is said
    if more.cause is not None:
        found = dataclasses.replace(found, aborted=True)
    return Proved(now.loaded, more, found, dataclasses.replace(now.recording, info=info))


def refuted_names(found: Identification) -> tuple[str, ...]:
    """The names of the final model that the proof refutes."""
    proof = found.proof
    return () if proof is None else tuple(n for n, one in proof.effects.items() if one.status == "refuted")


def _identified_without(context: CommandContext, now: Proved, refuted: tuple[str, ...]) -> Proved | None:
    """Identified from all data with the refuted names excluded; None where that fails, and what stood stands."""
    from identify.proof.wording import lines
    from identify.wording import joined, plain

    context.terminal.note(f"refuted: {joined([plain(n) for n in refuted])}; identifying again from all data without")
    proof = now.found.proof
    assert proof is not None
    excluded = (*proof.excluded, *refuted)
    loaded = without_names(now.loaded, refuted)
    everything = now.played.complete_runs
    try:
        newer = identified(context, loaded, everything)
    except (Aborted, KeyboardInterrupt, UsageError) as error:
        context.say_error(error)
        return None
    told = tuple(lines(dataclasses.replace(proof, excluded=())))  # what is excluded is said behind it, once
    kept = dataclasses.replace(proof, excluded=excluded, earlier=told, effects={}, rivals={}, lines=())
    newer = dataclasses.replace(newer, proof=kept, follow_up=now.found.follow_up)
    return Proved(loaded, now.played, newer, everything)


def without_names(loaded: LoadedConfig, names: tuple[str, ...]) -> LoadedConfig:
    """The configuration with these effects neither declared nor tried."""
    from rig import effects

    config = loaded.config
    gone = {effects.first_of(name) for name in names}
    tried = effects.known() if config.identify.candidates is None else config.identify.candidates
    left = tuple(name for name in tried if name not in gone)
    declared = {n: v for n, v in config.model.effects.items() if effects.first_of(n) not in gone}
    changed = {
        "identify": config.identify.model_copy(update={"candidates": left}),
        "model": config.model.model_copy(update={"effects": declared}),
    }
    return dataclasses.replace(loaded, config=config.model_copy(update=changed))
