"""Numbers as a person reads them."""

from __future__ import annotations

import pytest

from identify.wording import interval_of, joined, number, percent, plain, readable, title, unit, value_of, with_interval
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


def test_a_value_has_the_digits_that_its_standard_error_deserves() -> None:
    assert value_of(estimate(677.3123456, 0.012)) == "677.312"
    assert value_of(estimate(677.3123456, 40.0)) == "677"
    assert interval_of(estimate(0.045, 0.0005)) == "0.04402 to 0.04598"
    assert interval_of(estimate(-0.274, 0.144)) == "-0.556 to 0.008"


def test_an_uneven_or_open_interval_is_written_with_both_ends() -> None:
    assert with_interval(estimate(2.0, 0.01)) == "2.000 ± 0.020"
    uneven = estimate(2.0, 0.01)
    object.__setattr__(uneven, "ci95", (1.9, 2.5))
    assert with_interval(uneven) == "2.000 (1.900 to 2.500)"
    object.__setattr__(uneven, "ci95", (1.9, float("inf")))
    assert with_interval(uneven) == "2.000 (1.900 to unbounded)"


@pytest.mark.parametrize(("value", "shown"), [(822.1, "+822 %"), (-0.0987, "-0.099 %"), (0.0, "0 %"), (None, "-")])
def test_percentages_carry_their_sign(value: float | None, shown: str) -> None:
    assert percent(value) == shown


def test_names_and_units_are_those_of_the_field() -> None:
    assert plain("stribeck_friction") == "Stribeck friction"
    assert title("inertia", "linear") == "mass J"
    assert unit("N*m*s^2/rad^2") == "N·m·s²/rad²"


def test_a_short_time_is_read_in_milliseconds_and_a_long_one_in_seconds() -> None:
    short = readable(estimate(6e-4, 4e-7, "s"))
    assert f"{value_of(short)} {short.unit}" == "0.60000 ms"
    assert interval_of(short) == "0.59922 to 0.60078"
    assert readable(estimate(0.89, 0.01, "s")).unit == "s"
    assert readable(estimate(0.02, 0.01, "N*m")).unit == "N*m"


@pytest.mark.parametrize(
    ("words", "said"), [([], ""), (["a"], "a"), (["a", "b"], "a and b"), (list("abc"), "a, b and c")]
)
def test_lists_read_like_speech(words: list[str], said: str) -> None:
    assert joined(words) == said
