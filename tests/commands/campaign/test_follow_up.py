"""Why a follow-up is not played: the same words wherever nobody agreed to it, so that a replay has the same result."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest

from commands.campaign.context import CommandContext, Options
from commands.campaign.follow_up import NOT_CONFIRMED, play_follow_up
from rig.config.load import load_config
from rig.errors import UsageError

BENCH = Path(__file__).parents[3] / "examples" / "bench.yaml"
REPLAY = ("bench.replay=somewhere",)


def refused(monkeypatch: pytest.MonkeyPatch, terminal: bool, *overrides: str, emulate: bool = False) -> str:
    monkeypatch.setattr("commands.campaign.follow_up.on_terminal", lambda: terminal)
    nothing = cast(Any, None)
    context = CommandContext(Options(BENCH, emulate=emulate), nothing, nothing)
    with pytest.raises(UsageError) as caught:
        play_follow_up(context, load_config(BENCH, overrides), nothing, nothing, {}, None, 1, "to part rivals")
    return str(caught.value)


def test_a_campaign_without_a_terminal_and_its_replay_say_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    live = refused(monkeypatch, False, emulate=True)
    assert live == NOT_CONFIRMED
    assert refused(monkeypatch, False, *REPLAY) == live
    assert refused(monkeypatch, True, *REPLAY) == live, "as an operator who said no"


def test_never_is_never(monkeypatch: pytest.MonkeyPatch) -> None:
    for overrides in ((), REPLAY):
        assert "follow_up is never" in refused(monkeypatch, True, "identify.follow_up=never", *overrides)


def test_a_replay_of_one_that_was_allowed_says_why_it_cannot(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "no further data" in refused(monkeypatch, True, "identify.follow_up=auto", *REPLAY)
