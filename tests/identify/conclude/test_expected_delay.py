"""The fitted delay stands beside the one that whoever recorded the data expects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from identify.conclude.expected_delay import delay_lines
from identify.report.files import result_json
from identify.report.page import report_html
from identify.report.summary import summary
from identify.results import Identification
from tests.identify.sample import estimate, sample

INFO = {"expected_torque_delay": {"delay_s": 0.0, "corrections": ["gyro group delay 2.2 ms", "torque as sent"]}}


def with_delay(delay_s: float | None, std_error_s: float = 1e-6, unexplained: bool = False) -> Identification:
    """The sample with another delay found, or none."""
    found = sample(2.0)[0]
    assert found.after is not None
    effects = {name: p for name, p in found.after.effect_parameters.items() if name != "torque_delay"}
    if delay_s is not None:
        effects["torque_delay"] = {"delay": estimate(delay_s, std_error_s, "s")}
    verdict = replace(found.verdict, unexplained=unexplained)
    return replace(found, after=replace(found.after, effect_parameters=effects), verdict=verdict)


def test_fitted_expected_corrections_and_the_difference_are_told() -> None:
    assert delay_lines(with_delay(1.23e-4), INFO) == (
        "Fitted: 0.1230 ± 0.0020 ms (95 %); the drivers expect 0 ms, their own corrections made (gyro group delay "
        "2.2 ms, torque as sent).",
        "0.123 ms is not explained by known device delays: look at the bus, the amplifier and the sensor.",
    )


def test_a_delay_that_agrees_with_what_is_expected_is_told_without_a_conclusion() -> None:
    (line,) = delay_lines(with_delay(1.0e-6), INFO)
    assert line.startswith("Fitted: 0.0010 ± 0.0020 ms (95 %); the drivers expect 0 ms")


def test_corrections_that_are_too_large_are_said_to_be() -> None:
    expecting = {"expected_torque_delay": {"delay_s": 5e-4, "corrections": []}}
    told = delay_lines(with_delay(1e-4), expecting)
    assert told[0].endswith("the drivers expect 0.500 ms.")
    assert told[1].startswith("Their corrections are 0.400 ms too large")


def test_without_a_fitted_delay_that_is_said() -> None:
    (line,) = delay_lines(with_delay(None), INFO)
    assert line.startswith("None is supported by these data; the drivers expect 0 ms")


def test_nothing_is_concluded_while_a_residual_is_unexplained() -> None:
    assert len(delay_lines(with_delay(1.23e-4, unexplained=True), INFO)) == 1


@pytest.mark.parametrize(
    "info",
    [
        {},
        {"expected_torque_delay": None},
        {"expected_torque_delay": "0"},
        {"expected_torque_delay": {"delay_s": "0"}},
        {"expected_torque_delay": {"delay_s": float("nan")}},
    ],
)
def test_a_recording_that_expects_nothing_adds_nothing(info: dict[str, Any]) -> None:
    assert delay_lines(with_delay(1e-4), info) == ()


def test_summary_and_report_show_it_and_result_json_keeps_its_keys() -> None:
    found, recording = with_delay(1.23e-4), sample(2.0)[1]
    words = "the drivers expect 0 ms"
    assert "Fitted: 0.1230 ± 0.0020 ms" in summary(found, info=INFO) and words in summary(found, info=INFO)
    assert words not in summary(found)
    page = report_html(found, replace(recording, info=INFO), "bench")
    assert "<h3>Torque delay</h3>" in page and words in page
    assert "expected_torque_delay" not in result_json(found)


def test_what_a_recording_says_cannot_steer_the_terminal() -> None:
    evil = {"expected_torque_delay": {"delay_s": 0.0, "corrections": ["\x1b[31m"]}}
    assert "\x1b" not in summary(with_delay(1e-4), info=evil)
