"""Numbers as a person reads them."""

from __future__ import annotations

import math

import pytest

from identify.wording import (
    in_order,
    interval_of,
    joined,
    number,
    off_by,
    percent,
    plain,
    readable,
    sentence,
    signed,
    title,
    unbroken,
    unit,
    value_in_sentence,
    value_of,
    with_interval,
    without,
)
from tests.identify.sample import estimate


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [
        (677.3, 4, "677.3"),
        (0.045, 4, "0.04500"),
        (0.0, 4, "0"),
        (123456.0, 3, "123456"),
        (1.5e-9, 2, "1.5e-09"),
        (-2.5e9, 2, "-2.5e+09"),
        (9.9999, 2, "10"),
        (None, 4, "-"),
        (float("nan"), 4, "-"),
        (float("inf"), 4, "unbounded"),
    ],
)
def test_numbers_stay_short(value: float | None, digits: int, shown: str) -> None:
    assert number(value, digits) == shown


@pytest.mark.parametrize(
    ("value", "std_error", "shown"),
    [
        (677.3123456, 0.012, "677.312 ± 0.024"),
        (0.0447084, 6e-6, "0.044708 ± 0.000012"),
        (0.599959, 4.2e-5, "0.59996 ± 0.00008"),
        (677.3123456, 40.0, "680 ± 80"),
        (123456.0, 3000.0, "123000 ± 6000"),
        (-0.274, 0.144, "-0.27 ± 0.28"),
        (9.99999, 0.4, "10.0 ± 0.8"),
        (1e-7, 0.02, "0.00 ± 0.04"),
        (-0.001, 0.02, "0.00 ± 0.04"),
        (0.0, 0.02, "0.00 ± 0.04"),
        (1.5e-9, 2e-10, "1.5e-09 ± 4e-10"),
        (2.5e9, 1e7, "2.500e+09 ± 2.0e+07"),
        (5.0, 0.0, "5.000 ± 0"),
    ],
)
def test_a_value_ends_where_its_interval_begins(value: float, std_error: float, shown: str) -> None:
    assert with_interval(estimate(value, std_error)) == shown


def test_no_interval_is_narrow_enough_for_more_than_seven_digits() -> None:
    assert with_interval(estimate(681.20091234, 1e-8)) == "681.2009 ± 2.0e-08"
    assert with_interval(estimate(0.020300003, 6.1e-8)) == "0.02030000 ± 0.00000012"


def test_an_interval_has_the_decimals_of_its_value() -> None:
    assert interval_of(estimate(0.045, 0.0005)) == "0.0440 to 0.0460"
    assert interval_of(estimate(-0.274, 0.144)) == "-0.56 to 0.01"


def test_an_uneven_or_open_interval_is_written_with_both_ends() -> None:
    assert with_interval(estimate(2.0, 0.01)) == "2.000 ± 0.020"
    uneven = estimate(2.0, 0.01)
    object.__setattr__(uneven, "ci95", (1.9, 2.5))
    assert with_interval(uneven) == "2.00 (1.90 to 2.50)"
    object.__setattr__(uneven, "ci95", (1.9, float("inf")))
    assert with_interval(uneven) == "2.000 (1.900 to unbounded)"


def test_what_is_negative_or_positive_by_nature_carries_its_sign() -> None:
    assert [signed(x) for x in (-7936814889.9, 4.2, 0.0)] == ["-7.937e+09", "+4.200", "0"]


@pytest.mark.parametrize(
    ("value", "shown"), [(822.1, "+822 %"), (21206.4, "+21200 %"), (-0.0987, "-0.099 %"), (0.0, "0 %"), (None, "-")]
)
def test_percentages_carry_their_sign(value: float | None, shown: str) -> None:
    assert percent(value) == shown


def test_names_and_units_are_those_of_the_field() -> None:
    assert plain("stribeck_friction") == "Stribeck friction"
    assert title("inertia", "linear") == "mass J"
    assert unit("N*m*s^2/rad^2") == "N·m·s²/rad²"


def test_a_short_time_is_read_in_milliseconds_and_a_long_one_in_seconds() -> None:
    short = readable(estimate(6e-4, 4e-7, "s"))
    assert f"{value_of(short)} {short.unit}" == "0.6000 ms"
    assert interval_of(short) == "0.5992 to 0.6008"
    assert readable(estimate(0.89, 0.01, "s")).unit == "s"
    assert readable(estimate(0.02, 0.01, "N*m")).unit == "N*m"


@pytest.mark.parametrize(
    ("words", "said"), [([], ""), (["a"], "a"), (["a", "b"], "a and b"), (list("abc"), "a, b and c")]
)
def test_lists_read_like_speech(words: list[str], said: str) -> None:
    assert joined(words) == said


@pytest.mark.parametrize(
    ("words", "said"), [("held out.", "Held out."), ("blocks 3 and 9", "Blocks 3 and 9."), ("", "")]
)
def test_a_sentence_begins_with_a_capital_and_ends_with_one_full_stop(words: str, said: str) -> None:
    assert sentence(words) == said


@pytest.mark.parametrize(
    ("ratio", "words"),
    [(1.098, "9.8 % too high"), (0.9, "10 % too low"), (2.9, "190 % too high"), (16.43, "about 16 times too high"),
     (212.6, "about 210 times too high"),
     (-0.5, "of the wrong sign")],
)  # fmt: skip
def test_a_large_error_is_a_factor_and_a_small_one_a_percentage(ratio: float, words: str) -> None:
    assert off_by(ratio) == words


@pytest.mark.parametrize(
    ("value", "std_error", "said"),
    [(1.200004, 1e-6, "1.200"), (1.2, 0.05, "1.20"), (681234.0, 1.0, "681200"), (681234.0, 5000.0, "681000")],
)
def test_a_sentence_has_four_digits_at_most_and_no_more_than_the_interval(
    value: float, std_error: float, said: str
) -> None:
    assert value_in_sentence(estimate(value, std_error)) == said


def test_an_effect_without_which_nothing_is_worse_is_not_said_to_make_it_a_fraction_of_times_larger() -> None:
    assert "no larger" in without(0.31)
    assert "no larger" in without(1.004)
    assert "unbounded" in without(math.inf)
    assert "is 478 times as large." in without(478.0)


def test_j_c_and_k_stand_in_this_order_whatever_is_determined_first() -> None:
    assert in_order(["stiffness", "creep", "inertia", "stiffness", "damping"]) == [
        "inertia", "damping", "stiffness", "creep",
    ]  # fmt: skip


def test_a_number_and_its_unit_stay_on_one_line() -> None:
    assert unbroken("1.2 N·m and 0.6 ms, 1.3 % at 5 sets") == "1.2\u00a0N·m and 0.6\u00a0ms, 1.3\u00a0% at 5 sets"
