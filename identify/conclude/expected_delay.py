"""The fitted torque delay compared with the one that the drivers expect."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from identify.results import Identification, ParameterEstimate
from identify.wording import number, with_interval

KEY = "expected_torque_delay"
"""In ``Recording.info``: ``delay_s``, and ``corrections`` that were made before, in words."""
EFFECT, PARAMETER = "torque_delay", "delay"


def delay_lines(identification: Identification, info: Mapping[str, Any]) -> tuple[str, ...]:
    """What was fitted, what is expected, and what follows; nothing where the recording expects nothing."""
    expectation = info.get(KEY)
    expected_s = expectation.get("delay_s") if isinstance(expectation, Mapping) else None
    if not isinstance(expectation, Mapping) or not isinstance(expected_s, int | float) or not math.isfinite(expected_s):
        return ()
    found = identification.final.effect_parameters.get(EFFECT, {}).get(PARAMETER)
    fitted = "None is supported by these data" if found is None else f"Fitted: {with_interval(_in_ms(found))} ms (95 %)"
    corrections = expectation.get("corrections")
    made = [str(one) for one in corrections] if isinstance(corrections, list | tuple) else []
    after = f", their own corrections made ({', '.join(made)})" if made else ""
    expects = f"{fitted}; the drivers expect {number(1e3 * expected_s, 3)} ms{after}."
    # What lies between the two is only a delay where nothing else is left unexplained.
    return (expects,) if identification.verdict.unexplained else (expects, *_difference(found, expected_s))


def _in_ms(found: ParameterEstimate) -> ParameterEstimate:
    low, high = found.ci95
    return ParameterEstimate(1e3 * found.value, 1e3 * found.std_error, (1e3 * low, 1e3 * high), "ms")


def _difference(found: ParameterEstimate | None, expected_s: float) -> tuple[str, ...]:
    if found is None or found.ci95[0] <= expected_s <= found.ci95[1]:
        return ()
    beyond_ms = 1e3 * (found.value - expected_s)
    if beyond_ms > 0.0:
        return (
            f"{number(beyond_ms, 3)} ms is not explained by known device delays: "
            "look at the bus, the amplifier and the sensor.",
        )
    return (f"Their corrections are {number(-beyond_ms, 3)} ms too large: check the filter that the gyro is set to.",)
