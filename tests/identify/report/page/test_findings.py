"""What the first screen has said stands once."""

from __future__ import annotations

from dataclasses import replace

from identify.conclude.headline import headline
from identify.conclude.verdict import sentences_of
from identify.report.page.findings import further_findings
from identify.results import Identification
from tests.identify.sample import sample

FOUND, _ = sample(1.0)


def with_sentences(found: Identification, *more: str) -> Identification:
    return replace(found, verdict=replace(found.verdict, sentences=(*sentences_of(found), *more)))


def test_names_numbers_and_errors_of_the_first_screen_are_not_said_again() -> None:
    found = with_sentences(FOUND)
    above, below = " ".join(headline(found)), " ".join(further_findings(found))
    assert "Coulomb friction (level 1.200 N·m)" in above
    assert "; without it, " in above
    assert "1.1998" not in below
    assert "too high" not in below
    assert "Coulomb friction: without it, even after refitting, the error on held-out data is" in below


def test_what_stands_nowhere_else_stays() -> None:
    said = "The clocks of torque and rate drift apart."
    assert further_findings(with_sentences(FOUND, said))[-1] == said


def test_a_finding_that_the_first_screen_has_not_named_keeps_its_name_and_numbers() -> None:
    unnamed = replace(FOUND.verdict, effects=())
    found = replace(with_sentences(FOUND), verdict=replace(unnamed, sentences=sentences_of(FOUND)))
    assert further_findings(found)[0] == sentences_of(FOUND)[0]
