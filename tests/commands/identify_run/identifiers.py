"""What stands in for the identifier: it remembers what it was given and answers what a test wants."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType

import pytest

from identify.results import Identification
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording


class Identifier:
    """Answers in turn, the last answer for good."""

    def __init__(self, *answers: Identification | BaseException) -> None:
        self.given: list[tuple[Recording, Platform, IdentifyConfig]] = []
        self._answers = list(answers)

    def __call__(
        self,
        recording: Recording,
        declared: Platform,
        settings: IdentifyConfig,
        progress: Callable[[str], None] | None = None,
    ) -> Identification:
        self.given.append((recording, declared, settings))
        if progress is not None:
            progress("looking at the residual")
        answer = self._answers.pop(0) if len(self._answers) > 1 else self._answers[0]
        if isinstance(answer, BaseException):
            raise answer
        return answer

    @property
    def runs(self) -> list[list[str]]:
        """Names of the runs that it was given, call by call."""
        return [[run.name for run in recording.runs] for recording, _, _ in self.given]


def stand_in(monkeypatch: pytest.MonkeyPatch, *answers: Identification | BaseException) -> Identifier:
    """Put one in the identifier's place."""
    loop, identifier = ModuleType("identify.pipeline"), Identifier(*answers)
    loop.identify = identifier  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "identify.pipeline", loop)
    return identifier
