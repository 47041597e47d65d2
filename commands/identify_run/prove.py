"""Proves what was named, where `identify.prove` asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from commands.campaign.backends import backend_name
from commands.campaign.consent import consent_of
from commands.campaign.context import CommandContext
from commands.campaign.further_part import on_terminal
from commands.identification.proof import Proved, prove, why_no_proof
from commands.identification.results import write
from rig.errors import RigError, UsageError

if TYPE_CHECKING:
    from commands.campaign.campaign_part import PlayedCampaign
    from commands.campaign.results_folder import ResultsFolder
    from identify.results import Identification
    from rig.config.load import LoadedConfig

QUESTION = "Play the proof now? Type yes to play it: "
NOT_CONFIRMED = (
    "the proof was not played: identify.prove is ask, and nobody answered the question with yes (it is asked on a "
    "terminal only). To play it later: rig prove DIR"
)


def proved_if_asked(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, played: PlayedCampaign, found: Identification
) -> Proved:
    """The campaign with its proof, or as it is with a word on why there is none."""
    as_it_is = Proved(loaded, played, found, played.recording)
    mode = loaded.config.identify.prove
    if mode == "never" or found.aborted or played.cause is not None:
        return as_it_is
    why = why_no_proof(found) or _refusal(context, loaded)
    if why:
        context.terminal.show(f"No proof: {why}")
        return as_it_is
    write(context, loaded, folder, played.recording, found)
    try:
        return prove(context, loaded, folder, played, found, consent=consent_of(mode, QUESTION, NOT_CONFIRMED))
    except UsageError as refused:
        context.terminal.show_always(f"No proof: {refused}")
    except (RigError, KeyboardInterrupt) as error:  # before the first tick, at the question perhaps
        context.say_error(error)
    return as_it_is


def _refusal(context: CommandContext, loaded: LoadedConfig) -> str:
    """Why no proof is played, before anything is asked; empty where one may be."""
    config = loaded.config
    backend = backend_name(config, context.options.dry_run, context.options.emulate)
    if backend == "bench" and config.bench is not None and config.bench.replay is not None:
        return "a replayed capture holds no further data"
    if config.identify.prove == "ask" and not on_terminal():
        return NOT_CONFIRMED
    return ""
