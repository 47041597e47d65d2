"""Plays the runs of a proof into the results folder of its campaign, with its own pre-flight and consent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from commands.campaign.campaign_part import CampaignPart, PlayedCampaign
from commands.campaign.consent import Consent, ask_consent
from commands.campaign.context import CommandContext
from commands.campaign.further_part import further_config
from commands.campaign.playing import planned_sets, play
from commands.campaign.results_folder import RAW_FOLDER, ResultsFolder
from rig.config.load import LoadedConfig
from rig.excitation import PlannedSet
from rig.interface import Rig
from rig.platform import Platform
from rig.preflight import allowed_peaks
from rig.recording.run import Recording, Run

if TYPE_CHECKING:
    from identify.proof.plan import ProofPlan

PARTS_BEFORE = 10  # seeds of the follow-ups are those below


@dataclass
class ProofPart:
    """A proof to play.

    Parameters
    ----------
    model
        The identified platform: what is compensated, and what the pre-flight looks ahead with.
    rivals
        "effect / rival" -> the model with the rival in the place of the effect.
    angle
        Whether an encoder reads the motion.
    resolution_nm
        Step of the drive's torque, as far as the recording shows one.
    number
        Which proof of the campaign it is, from 1.
    recorded
        The runs of the campaign, which tell how the platform moves whatever the model says.
    noise
        Of the sensor, in which the ring of a run has to be lost before the next; None where it is not known.
    plan
        Made once the rig is there; None before.
    """

    model: Platform
    rivals: Mapping[str, Platform] = field(default_factory=dict)
    angle: bool = False
    resolution_nm: float | None = None
    number: int = 1
    recorded: Sequence[Run] = ()
    noise: float | None = None
    plan: ProofPlan | None = None

    @property
    def prefix(self) -> str:
        """What the names of its runs begin with: no two runs of a campaign have one name."""
        return "proof" if self.number == 1 else f"proof {self.number}"


def play_proof(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, earlier: PlayedCampaign | None,
    part: ProofPart, consent: Consent = ask_consent,
) -> PlayedCampaign:  # fmt: skip
    """Play the runs of a proof; returns all runs of the campaign so far, and leaves the plan in ``part``.

    Without ``earlier`` they are recorded into a folder of their own.

    Raises
    ------
    UsageError
        Where it may not be played: nothing was moved, and nothing of what stands in the folder is touched.
    """

    def sets(rig: Rig, loaded: LoadedConfig) -> tuple[PlannedSet, ...]:
        from identify.proof.drive import Drive, latency_of
        from identify.proof.plan import plan_proof
        from identify.proof.wording import plan_lines

        config = loaded.config
        allowed = allowed_peaks(config.limits, config.excitation.margin, rig.rate_full_scale_rad_s)
        asked = planned_sets(rig, loaded)
        tick_s = 1.0 / config.excitation.sample_rate_hz
        latency_s = latency_of(Recording(tuple(part.recorded)), asked, tick_s)
        drive = Drive(tick_s, rig.torque_hold, part.resolution_nm, latency_s)
        context.terminal.note("computing the torque that cancels the named effects")
        part.plan = plan_proof(
            part.model, asked, allowed, drive,
            angle=part.angle, rivals=part.rivals, prefix=part.prefix, recorded=part.recorded,
            rest_s=config.excitation.rest_s, noise=part.noise,
        )  # fmt: skip
        for line in plan_lines(part.plan, part.model, config.excitation.rest_s):
            context.terminal.show(line)
        return part.plan.sets

    name = part.prefix.replace(" ", "_")
    journal, raw = (f"{name}.journal", f"{RAW_FOLDER}/{name}") if earlier else (CampaignPart.journal, RAW_FOLDER)
    further = further_config(loaded, part.model, PARTS_BEFORE + part.number)
    campaign_part = CampaignPart(
        journal, raw, earlier, consent, plan=sets, rest_s=lambda: part.plan.rest_s if part.plan else None,
        listed="proofs", then="the verdict",
    )  # fmt: skip
    return play(context, further, folder, campaign_part)
