"""The follow-up in words: what to play and why, what was played, what came of it; and follow_up.yaml itself."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import yaml

from identify.results import FollowUp, FollowUpPlan, Parting, follow_up_file_name
from identify.wording import capital, joined, plain

if TYPE_CHECKING:
    from identify.follow_up.excitations import Candidate

PLENTY = 10_000.0  # chi square beyond which nobody asks how much


def why_of(partings: Sequence[Parting], sets: Sequence[Candidate]) -> str:
    """One sentence: what the sets are, and what they part."""
    words = joined(list(dict.fromkeys(c.words for c in sets)))
    parts = "separates" if len({c.words for c in sets}) == 1 else "separate"
    separated = joined([f"{plain(p.effect)} from {plain(p.rival)} (expected chi-square {size(p)})" for p in partings])
    return f"{capital(words)} {parts} {separated}."


def size(parting: Parting) -> str:
    """An expected separation, to two digits: it is no more exact than the models."""
    return f"{float(f'{parting.separation:.2g}'):,.0f}" if parting.separation < PLENTY else f"over {PLENTY:,.0f}"


def verdict_sentences(follow_up: FollowUp, inseparable: Collection[str] = ()) -> list[str]:
    """What the verdict adds: the plan, and the pairs that no plan parts for want of limits.

    ``inseparable``: pairs ("actuator_lag / sensor_lag") of which the verdict says already that nothing parts them.
    """
    out = []
    if follow_up.plan is not None:
        out.append(f"To separate what these data cannot: {_lower(follow_up.plan.why)}")
    out += [
        f"No follow-up for {plain(one.effect)} and {plain(one.rival)}: {one.reason}."
        for one in follow_up.unparted
        if not {f"{one.effect} / {one.rival}", f"{one.rival} / {one.effect}"} & set(inseparable)
    ]
    return out


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def lines(follow_up: FollowUp) -> list[str]:
    """What was played and where the plan is, one sentence each; the verdict says what the plan is for."""
    out = []
    for n, one in enumerate(follow_up.rounds, 1):
        head = "Played" if len(follow_up.rounds) == 1 else f"Played, {n}"
        out.append(f"{head}: {_lower(one.plan.why)}")
        out += [f"{capital(plain(a))} and {plain(b)} can be distinguished now." for a, b in one.separated]
        out += [f"{capital(plain(a))} and {plain(b)} still cannot be distinguished." for a, b in one.open]
    if follow_up.plan is not None:
        file = follow_up_file_name(len(follow_up.rounds))
        out.append(f"{file} ({follow_up.plan.duration_s:.0f} s) holds the excitation that the verdict describes.")
    if follow_up.note:
        out.append(capital(follow_up.note))
    return out


def follow_up_yaml(plan: FollowUpPlan) -> str:
    """The text of follow_up.yaml: an `excitation:` section that a rig.yaml may hold or name."""
    head = [
        plan.why,
        f"{plan.duration_s:.0f} s of torque, plus rests. Play it on the same rig: `excitation:` of its rig.yaml takes",
        "the path of this file (or --set excitation=PATH), then give all recordings to identify-run together.",
    ]
    text = yaml.safe_dump({"excitation": dict(plan.excitation)}, sort_keys=False, default_flow_style=None, width=110)
    return "".join(f"# {line}\n" for line in head) + text
