"""Plays a follow-up into the results folder of its campaign, with its own pre-flight and consent."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from commands.campaign.backends import backend_name
from commands.campaign.campaign_part import CampaignPart, PlayedCampaign
from commands.campaign.consent import ask_consent
from commands.campaign.context import CommandContext
from commands.campaign.playing import play
from commands.campaign.results_folder import RAW_FOLDER, ResultsFolder
from rig.config.excitation import ExcitationConfig
from rig.config.load import LoadedConfig
from rig.config.model import ModelConfig
from rig.errors import UsageError
from rig.interface import Statement, Torque
from rig.platform import Platform

NOT_CONFIRMED = (  # the same whether it was asked, could not be, or is a replay: results are compared
    "it was not played: identify.follow_up is ask, and the question was not answered with yes (without a terminal "
    "it is not asked). To play it without the question, set identify.follow_up: auto (real torque also needs --yes)"
)
QUESTION = "Play this follow-up now? Type yes to play it: "
NEXT_SEED = 1_000_003  # a simulated gyro must not repeat its noise


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
    part = CampaignPart(f"{name}.journal", f"{RAW_FOLDER}/{name}", earlier, _consent(mode))
    return play(context, _configured(loaded, excitation, model, number), folder, part)


def _refusal(context: CommandContext, loaded: LoadedConfig) -> str:
    """Why no follow-up is played, before anything is asked; empty where one may be."""
    config = loaded.config
    if config.identify.follow_up == "never":
        return "it was not played: identify.follow_up is never"
    backend = backend_name(config, context.options.dry_run, context.options.emulate)
    replayed = backend == "bench" and config.bench is not None and config.bench.replay is not None
    if config.identify.follow_up == "ask" and (replayed or not _on_terminal()):
        return NOT_CONFIRMED
    return "it was not played: a replayed capture holds no further data" if replayed else ""


def _on_terminal() -> bool:
    return sys.stdin is not None and sys.stdin.isatty()


def _consent(mode: str) -> Callable[[Statement, bool, bool, Callable[[str], str]], None]:
    """The question before a follow-up: --yes answers it only where the file says auto."""
    if mode == "auto":
        return ask_consent

    def ask_each_time(statement: Statement, yes: bool, is_terminal: bool, ask: Callable[[str], str]) -> None:
        if statement.torque is Torque.REAL:
            ask_consent(statement, False, is_terminal, ask)
            return
        try:
            answer = ask(QUESTION)
        except EOFError:
            answer = ""
        if answer.strip().lower() not in ("yes", "y"):
            raise UsageError(NOT_CONFIRMED)

    return ask_each_time


def _configured(
    loaded: LoadedConfig, excitation: Mapping[str, Any], model: Platform | None, number: int
) -> LoadedConfig:
    """The same configuration with another excitation, and with the identified platform to look ahead with."""
    config = loaded.config
    section = ExcitationConfig.model_validate_json(json.dumps(dict(excitation)), strict=True)
    seed = (config.simulated.seed + number * NEXT_SEED) % 2**32
    changed: dict[str, Any] = {
        "excitation": section, "simulated": config.simulated.model_copy(update={"seed": seed})
    }  # fmt: skip
    if model is not None:
        try:
            changed["model"] = ModelConfig.from_platform(model)
        except ValueError:  # numbers that no model may have: the declared one looks ahead
            changed.pop("model", None)
    return replace(loaded, config=config.model_copy(update=changed))
