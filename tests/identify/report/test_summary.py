"""The terminal summary: complete, narrow, plain."""

from __future__ import annotations

from dataclasses import replace

import pytest

from identify.report.summary import summary
from tests.identify.sample import sample, unhappy


def test_a_person_hears_verdict_parameters_errors_sets_and_outcome() -> None:
    said = summary(sample(2.0)[0])
    for words in (
        "Coulomb friction is missing: 1.1998 N·m",
        "0.0447012 ± 0.0000012",
        "+822 %",
        "simulation error, held-out rate",
        "0.0008727",
        "undetermined",
        "Max_Error",
    ):
        assert words in said, words
    outcome = said.rstrip().splitlines()[-2:]
    assert outcome == ["ACCEPTED", "  - J, C and K are determined, and what is left is at the noise floor."]
    assert "NOT ACCEPTED" not in said


def test_what_the_missing_effects_did_is_said_by_the_verdict_and_the_table_and_not_once_more() -> None:
    sentence = "Without Coulomb friction and torque delay in the model, damping C is about 9.2 times too high."
    found = sample(2.0)[0]
    verdict = replace(found.verdict, sentences=(*found.verdict.sentences, sentence))
    said = summary(replace(found, verdict=verdict))
    assert said.count("too high") == 1
    assert said.count("822 %") == 1


def test_what_was_dropped_or_not_determined_is_said_with_its_reason_and_what_to_do() -> None:
    said = summary(unhappy())
    for words in (
        "Damping: its interval spans zero",
        "Stiffness over inertia: no run returns to rest: record one that does",
        "ABORTED",
        "Next: run `free_decay` for 20 s from 5 deg.",
        "simulation error, held-out position",
    ):
        assert words in said, words


def test_what_the_reasons_say_is_not_said_again() -> None:
    found = unhappy()
    reasons = (*found.reasons, "stiffness_over_inertia is not determined: no run returns to rest: record one that does")
    said = summary(replace(found, reasons=reasons), 200)
    assert said.count("no run returns to rest") == 1
    assert "Not determined by these data" not in said


def test_a_campaign_that_fails_says_so_last() -> None:
    said = summary(replace(unhappy(), aborted=False))
    assert said.index("NOT ACCEPTED") < said.index("Next: run")


@pytest.mark.parametrize("width", [80, 96])
def test_no_line_is_wider_than_asked(width: int) -> None:
    for identification in (sample(2.0)[0], unhappy()):
        assert max(len(line) for line in summary(identification, width).splitlines()) <= width


def test_without_a_terminal_there_is_no_colour_and_with_one_there_is() -> None:
    assert "\x1b" not in summary(sample(2.0)[0])
    assert "\x1b" in summary(sample(2.0)[0], colour=True)


def test_a_name_cannot_steer_the_terminal() -> None:
    found = sample(2.0)[0]
    evil = replace(found.per_set[0], name="\x1b[2J\x07run")
    said = summary(replace(found, per_set=(evil,), reasons=("\x1b[31m",)))
    assert "\x1b" not in said
    assert "?[2J?run" in said


def test_it_fits_an_encoding_of_a_plain_windows_console() -> None:
    assert summary(sample(2.0)[0]).encode("cp1252")


def test_declared_numbers_stand_beside_the_fitted_ones_where_somebody_declared_them() -> None:
    found = sample(2.0)[0]
    assert "declared value" not in summary(found)
    beside = {"inertia": 0.02, "torque_delay.delay": 5e-4}
    rows = summary(replace(found, declared=beside)).splitlines()
    assert any(r.split()[:1] == ["declared"] for r in rows)
    assert next(r for r in rows if "rotary inertia J  " in r).split()[3] == "0.02"
    assert next(r for r in rows if "torque delay, delay" in r).split()[3] == "0.5"  # ms, as the row
    assert next(r for r in rows if r.startswith("damping C")).split()[2] == "0.412"  # declared by nobody


def test_on_a_narrow_terminal_an_interval_stands_below_its_value_and_not_in_two() -> None:
    lines = summary(sample(1.0)[0], width=80).splitlines()
    (inertia,) = [i for i, line in enumerate(lines) if line.startswith("rotary inertia J")]
    assert lines[inertia + 1].split()[0] == "±" and len(lines[inertia + 1].split()) == 2
    assert max(len(line) for line in lines) <= 80
