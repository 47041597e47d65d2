"""Plays a follow-up into the results folder of its campaign, with its own pre-flight and consent."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from commands.campaign.backends import backend_name
from commands.campaign.campaign_part import CampaignPart, PlayedCampaign
from commands.campaign.consent import consent_of
from commands.campaign.context import CommandContext
from commands.campaign.further_part import further_config, on_terminal
from commands.campaign.playing import play
from commands.campaign.results_folder import RAW_FOLDER, ResultsFolder
from rig.config.excitation import ExcitationConfig
from rig.config.load import LoadedConfig
from rig.errors import UsageError
from rig.platform import Platform

NOT_CONFIRMED = (  # the same whether it was asked, could not be, or is a replay: results are compared
    "it was not played: identify.follow_up is ask, and nobody answered the question with yes (it is asked on a "
    "terminal only). To play it without the question, set identify.follow_up: auto (real torque also needs --yes)"
)
QUESTION = "Play this follow-up now? Type yes to play it: "


def play_follow_up(
    context: CommandContext,
    loaded: LoadedConfig,
    folder: ResultsFolder,
    earlier: PlayedCampaign,
    excitation: Mapping[str, Any],
    model: Platform | None,
    number: int,
    why: str,
) -> PlayedCampaign:
    """Play a further excitation into the same folder; returns all runs of the campaign so far.

    Parameters
    ----------
    excitation
        An `excitation` section.
    model
        The identified platform, which the pre-flight looks ahead with; None for the declared one.
    number
        Which follow-up it is, from 1.

    Raises
    ------
    UsageError
        Where it may not be played: nothing was moved, and nothing of what stands in the folder is touched.
    """
    mode = loaded.config.identify.follow_up
    refusal = _refusal(context, loaded)
    if refusal:
        raise UsageError(refusal)
    context.terminal.show(f"Follow-up {number}: {why}")
    if mode == "ask" and context.options.quiet:
        context.terminal.show_always(f"Follow-up {number}: {why}")  # nobody can answer a question without its reason
    name = "follow_up" if number == 1 else f"follow_up_{number}"
    part = CampaignPart(f"{name}.journal", f"{RAW_FOLDER}/{name}", earlier, consent_of(mode, QUESTION, NOT_CONFIRMED))
    section = ExcitationConfig.model_validate_json(json.dumps(dict(excitation)), strict=True)
    return play(context, further_config(loaded, model, number, section), folder, part)


def _refusal(context: CommandContext, loaded: LoadedConfig) -> str:
    """Why no follow-up is played, before anything is asked; empty where one may be."""
    config = loaded.config
    if config.identify.follow_up == "never":
        return "it was not played: identify.follow_up is never"
    backend = backend_name(config, context.options.dry_run, context.options.emulate)
    replayed = backend == "bench" and config.bench is not None and config.bench.replay is not None
    if config.identify.follow_up == "ask" and (replayed or not on_terminal()):
        return NOT_CONFIRMED
    return "it was not played: a replayed capture holds no further data" if replayed else ""
