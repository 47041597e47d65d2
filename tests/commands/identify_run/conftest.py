"""The identifier and the planner of a follow-up, stubbed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from identify.results import FollowUp, FollowUpPlan, Identification
from tests.commands.identify_run.follow_ups import Stub, plan_of
from tests.commands.identify_run.identifiers import Identifier, stand_in
from tests.identify.sample import sample


@pytest.fixture
def stubbed(monkeypatch: pytest.MonkeyPatch) -> Callable[[Identification | BaseException], Identifier]:
    return lambda answer: stand_in(monkeypatch, answer)


@pytest.fixture
def accepted(stubbed: Callable[[Identification], Identifier]) -> Identifier:
    return stubbed(sample(1.0)[0])


@pytest.fixture
def stub(monkeypatch: pytest.MonkeyPatch) -> Stub:
    """Let the identifier answer as told, and the planner plan what is given (one plan a call)."""

    def made(*answers: Identification | BaseException, plans: tuple[FollowUpPlan, ...] = (plan_of(),)) -> Identifier:
        left = list(plans)

        def plan(found: Identification, *_: Any) -> FollowUp | None:
            doubt = any(found.verdict.confusable_with.values())
            return FollowUp(left.pop(0) if left else None) if doubt else None

        monkeypatch.setattr("identify.follow_up.planner.plan_follow_up", plan)
        monkeypatch.setattr("identify.follow_up.rounds.errors_on", lambda model, found, recording: found.before.error)
        return stand_in(monkeypatch, *answers)

    return made
