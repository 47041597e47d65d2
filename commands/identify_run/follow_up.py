"""Plans a follow-up if effects cannot be distinguished, plays it, and identifies again from all data."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from commands.campaign.context import CommandContext
from commands.identification.results import identified, write

if TYPE_CHECKING:
    from commands.campaign.campaign_part import PlayedCampaign
    from commands.campaign.results_folder import ResultsFolder
    from identify.results import Identification
    from rig.config.load import LoadedConfig
    from rig.platform import Platform
    from rig.preflight import Peaks
    from rig.recording.run import Recording

STOPPED_AGAIN = "stopped during identification with all data: these are the results without the follow-up"


def followed_up(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, played: PlayedCampaign, found: Identification
) -> tuple[PlayedCampaign, Identification]:
    """Plan a follow-up where a name has a rival, play it where it may be played, identify again from all the data.

    Whatever a follow-up ends in, what stood before it stands: results are written before it is played.
    """
    from identify.follow_up.rounds import promises_more
    from rig.preflight import allowed_peaks

    config = loaded.config
    allowed = allowed_peaks(config.limits, config.excitation.margin, played.rate_full_scale_rad_s)
    rate_hz, earlier_model = config.excitation.sample_rate_hz, found.final.platform
    found = with_plan(context, loaded, played.recording, found, allowed, rate_hz)
    for number in (1, 2):
        if found.aborted or not promises_more(found):
            break
        write(context, loaded, folder, played.recording, found)
        played, found, is_new = _played_on(context, loaded, folder, played, found, number)
        if not is_new:
            break
        played, found, is_new = _identified_again(context, loaded, played, found, earlier_model)
        if not is_new:
            break
        found = with_plan(context, loaded, played.recording, found, allowed, rate_hz)
    return played, found


def with_plan(
    context: CommandContext,
    loaded: LoadedConfig,
    recording: Recording,
    found: Identification,
    allowed: Peaks,
    rate_hz: float,
) -> Identification:
    """With a follow-up planned, where a name has a rival; a stop on the way leaves what was found, marked aborted."""
    from identify.follow_up.planner import plan_follow_up, with_follow_up
    from rig.errors import Aborted

    rounds = len(found.follow_up.rounds) if found.follow_up else 0
    prefix = "follow-up" if rounds == 0 else f"follow-up {rounds + 1}"
    if any(found.verdict.confusable_with.values()):
        context.note("planning a follow-up that separates the candidate effects")
    try:
        planned = plan_follow_up(
            found, dataclasses.replace(recording, info={}), allowed, rate_hz, loaded.config.excitation.rest_s, prefix
        )
    except (Aborted, KeyboardInterrupt):
        reasons = ("stopped while a follow-up was planned", *found.reasons)
        return dataclasses.replace(found, aborted=True, accepted=False, reasons=reasons)
    return with_follow_up(found, planned)


def _played_on(
    context: CommandContext,
    loaded: LoadedConfig,
    folder: ResultsFolder,
    played: PlayedCampaign,
    found: Identification,
    number: int,
) -> tuple[PlayedCampaign, Identification, bool]:
    """Play what is planned; the last of the three says whether all of it is there to identify from."""
    from commands.campaign.follow_up import play_follow_up
    from rig.errors import RigError, UsageError

    plan = found.follow_up.plan if found.follow_up else None
    if plan is None:
        return played, found, False
    try:
        more = play_follow_up(context, loaded, folder, played, plan.excitation, found.final.platform, number, plan.why)
    except UsageError as refused:
        return played, _noted(found, str(refused)), False
    except (RigError, KeyboardInterrupt) as error:  # before the first tick, at the question perhaps
        context.say_error(error)
        note = f"the follow-up was not played: {str(error) or 'stopped by Ctrl-C'}"
        return dataclasses.replace(played, cause=error), _noted(found, note, aborted=True), False
    if more.cause is None:
        return more, found, True
    note = f"the follow-up was cut short, so these are the results without it: {more.cause}"
    return more, _noted(found, note, aborted=True), False


def _identified_again(
    context: CommandContext,
    loaded: LoadedConfig,
    played: PlayedCampaign,
    found: Identification,
    earlier_model: Platform | None,
) -> tuple[PlayedCampaign, Identification, bool]:
    """Identify from all the data; where that fails or is stopped, what was found before stands."""
    from identify.follow_up.rounds import after_playing
    from rig.errors import Aborted, UsageError

    stopped: BaseException = Aborted(STOPPED_AGAIN)
    try:
        newer = identified(context, loaded, played.recording)
        if not newer.aborted:
            return played, after_playing(found, newer, earlier_model, played.recording), True
    except (Aborted, KeyboardInterrupt) as error:
        stopped = error
    except UsageError as error:
        return played, _noted(found, f"the follow-up was played, but its data cannot be used: {error}"), False
    return dataclasses.replace(played, cause=stopped), _noted(found, STOPPED_AGAIN, aborted=True), False


def _noted(found: Identification, note: str, aborted: bool = False) -> Identification:
    """With a word on why the plan was not played, or what came of it."""
    follow_up = found.follow_up
    if follow_up is not None:
        found = dataclasses.replace(found, follow_up=dataclasses.replace(follow_up, note=note))
    return dataclasses.replace(found, aborted=found.aborted or aborted)
