"""The first screen in three sentences."""

from __future__ import annotations

from dataclasses import replace

from identify.conclude.headline import accepted_or_not, headline
from identify.residual import Dependence, Disturbance
from tests.identify.sample import sample, unhappy

FOUND, _ = sample(2.0)


def test_what_was_found_what_it_changes_and_why_it_is_accepted_are_three_sentences() -> None:
    found, error, accepted = headline(FOUND)
    assert found.startswith("The declared model lacks Coulomb friction (level 1.")
    assert "and torque delay (delay 0.6003 ms)." in found
    assert "falls from" in error and "rad/s" in error and "C would be about 9.2 times too high" in error
    assert accepted == "Accepted: J, C and K are determined, and what is left is at the noise floor."


def test_beside_what_is_named_the_first_screen_says_that_something_is_left_open() -> None:
    more = replace(FOUND, verdict=replace(FOUND.verdict, left_open="Creep would explain part of what is missing."))
    assert headline(more)[0].endswith(", and one more effect that these data do not determine.")


def test_an_error_that_reads_the_same_before_and_after_does_not_fall() -> None:
    same = replace(FOUND.before.error, holdout_rate_rms=FOUND.final.error.holdout_rate_rms)
    _, error, _ = headline(replace(FOUND, before=replace(FOUND.before, error=same)))
    assert "stays at" in error and "falls" not in error


def test_without_a_change_the_model_that_stands_is_spoken_of_alone() -> None:
    plain = replace(FOUND, after=None, verdict=replace(FOUND.verdict, effects=()))
    found, error, _ = headline(plain)
    assert found == "The declared model describes these runs: no effect is missing."
    assert error.startswith("Its error on held-out data is") and "falls" not in error
    lost = replace(plain, verdict=replace(plain.verdict, unexplained=True))
    little = "The declared model describes these runs: what is left is too little to matter."
    assert headline(replace(lost, accepted=True))[0] == little
    lost = replace(lost, accepted=False, reasons=("it leaves much",))
    assert headline(lost)[0] == "The declared model lacks something that no effect here describes."


def test_what_is_left_is_said_with_its_size_and_what_it_moves() -> None:
    left = Disturbance(0.2, "N*m", 0.02, (Dependence("angle", 0.1, 0.015, 1e-6),), {"inertia": 0.4, "stiffness": 1.2})
    said = accepted_or_not(replace(FOUND, disturbance=left))
    part = "the part of the residual torque that depends on the angle is 1.5 % of the torque"
    assert f"{part} and changes J by 0.40 % and K by 1.2 % when it is fitted, which is allowed" in said
    noise = replace(left, depends_on=(), moves_percent={})
    assert "(2.0 % of the torque, sensor noise removed) depends on no quantity that was tested" in accepted_or_not(
        replace(FOUND, disturbance=noise)
    )


def test_a_refusal_gives_its_first_reasons_and_counts_the_rest() -> None:
    refused = replace(FOUND, accepted=False, reasons=("one is wrong", "two is wrong", "three is wrong"))
    assert accepted_or_not(refused) == "Not accepted: one is wrong; two is wrong (1 more reason below)."
    assert accepted_or_not(replace(refused, aborted=True)).startswith("Aborted: ")
    assert len(headline(unhappy())) == 3


def test_where_the_torque_decided_the_error_is_a_share_of_the_torque() -> None:
    assert FOUND.after is not None
    error = replace(FOUND.after.error, holdout_measure="holdout_torque_relative", holdout_torque_relative=0.021)
    before = replace(FOUND.before.error, holdout_torque_relative=0.4)
    by_torque = replace(FOUND, after=replace(FOUND.after, error=error), before=replace(FOUND.before, error=before))
    assert "from 40.0 to 2.10 % of the torque" in headline(by_torque)[1]


def test_a_torque_of_which_nothing_is_left_is_not_told_as_zero_percent() -> None:
    none_left = replace(FOUND, disturbance=Disturbance(0.0, "N*m", 0.0))
    assert accepted_or_not(none_left).endswith("and no torque is left above the sensor's noise.")
