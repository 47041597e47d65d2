"""Sentences on what a residual consists of."""

from __future__ import annotations

from collections.abc import Sequence

from identify.results import FreeLine, Harmonics, Moment, ResidualDiagnosis, Share
from identify.wording import joined, number, unit

WORTH, WORTH_OF_PAST = 0.02, 0.1  # shares of the residual's power below which nothing is said
NOISE_LEVEL = 1.3**2  # reduced chi-square
TWIN = {"angle": "position", "rate": "speed", "torque": "force"}  # on a linear axis
LINEAR = (
    "a residual at the excitation frequency alone has a linear cause: "
    "a delay, a lag, creep, a second mode, a drifting spring"
)
ODD = "odd harmonics come from causes that are symmetric about rest: friction, a cubic spring, backlash, saturation"
EVEN = "even harmonics come from asymmetric causes: a one-sided or quadratic spring, unbalance, an offset"


def diagnosis_sentences(found: ResidualDiagnosis, axis: str) -> tuple[str, ...]:
    """How far above the noise, then where it lives, one finding a sentence; nothing that chance would show."""
    said = [
        *_harmonics(found.harmonics),
        *(_line(line, found) for line in found.free_lines),
        *_direction(found.direction),
        *_memory(found.memory),
        *_moments(found.moments),
    ]
    said = [_level(found, bool(said)), *said] if found.over_floor is not None or said else []
    return tuple(_on(axis, text) for text in said if text)


def is_significant(share: Share | None, worth: float = WORTH) -> bool:
    """Whether a share is more than chance shows, and large enough to report."""
    return share is not None and share.share > share.by_chance and share.share >= worth


def _level(found: ResidualDiagnosis, more: bool) -> str:
    over, what = found.over_floor, "The torque residual" if found.quantity == "torque" else "The error in free run"
    if over is None:
        return ""
    if not more and over**2 < NOISE_LEVEL:
        return f"{what} is at the level of the sensor's noise ({number(over, 3)} times) and shows no structure."
    looked_for = "harmonics, free lines, direction or memory" if found.direction is not None else "free lines"
    rest = "" if more else f"; it shows no {looked_for}"
    return f"{what} is {number(over, 3)} times the level of the sensor's noise{rest}."


def _harmonics(found: Harmonics | None) -> list[str]:
    if found is None or not is_significant(found.repeats):
        return []
    begin = f"{_percent(found.repeats.share)} of it repeats with the excitation"
    if found.own is None or found.odd is None or found.even is None:
        return [
            f"{begin}. The excitation itself contains odd and even harmonics, so harmonics made by the platform "
            "cannot be separated from them."
        ]
    parts, why = [], []
    if is_significant(found.own):
        parts.append(f"{_percent(found.own.share)} at the excitation frequency")
    for share, parity, rest, meaning in ((found.odd, "odd", 1, ODD), (found.even, "even", 0, EVEN)):
        if is_significant(share):
            orders = [f"{_nth(k)} {_percent(v)}" for k, v in found.orders.items() if k % 2 == rest and k > 1][:3]
            parts.append(
                f"{_percent(share.share)} in {parity} harmonics" + (f" ({', '.join(orders)})" if orders else "")
            )
            why.append(meaning)
    if not parts:
        return [f"{begin}."]
    return [f"{begin}: {joined(parts)}; {'; '.join(why or [LINEAR])}."]


def _line(line: FreeLine, found: ResidualDiagnosis) -> str:
    runs = f", in {line.runs} runs" if line.runs > 1 else ""
    return (
        f"A spectral line at {number(line.frequency_hz, 4)} Hz ({number(line.size, 2)} {unit(found.unit)}{runs}) is "
        "not a harmonic of any excitation. Look for a machine that rotates or vibrates at that frequency."
    )


def _direction(share: Share | None) -> list[str]:
    if share is None or not is_significant(share):
        return []
    return [
        f"{_percent(share.share)} of it changes sign with the direction of motion at the same angle: friction or "
        "hysteresis."
    ]


def _memory(share: Share | None) -> list[str]:
    if share is None or not is_significant(share, WORTH_OF_PAST):
        return []
    return [
        f"{_percent(share.share)} of it depends on the past and not on the present angle, rate and torque: "
        "hysteresis, creep or a second mode."
    ]


def _moments(found: Sequence[Moment]) -> list[str]:
    if not found:
        return []
    places = [f"{m.run} from {m.from_s:.2f} to {m.to_s:.2f} s ({_percent(m.share)})" for m in found]
    share = _percent(sum(m.share for m in found))
    return [
        f"{share} of it lies in {joined(places)}: probably a single event (a touch, a slip, the start of a run). "
        "Exclude it with from_s or to_s, or record the run again."
    ]


def _percent(share: float) -> str:
    return f"{min(100.0 * share, 100.0):.{0 if share >= 0.1 else 1}f} %"


def _nth(order: int) -> str:
    return f"{order}" + {2: "nd", 3: "rd"}.get(order, "th")


def _on(axis: str, text: str) -> str:
    if axis == "linear":
        for rotary, linear in TWIN.items():
            text = text.replace(f"{rotary} ", f"{linear} ").replace(f"{rotary}:", f"{linear}:")
            text = text.replace(f"{rotary},", f"{linear},")
    return text
