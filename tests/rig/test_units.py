"""Units as people write them are known with their factor; what is not known is not guessed."""

from __future__ import annotations

import math

import pytest

from rig.units import name_and_unit, unit_of

DEG, FOOT_POUND = math.pi / 180, 1.3558179483314
KNOWN = {
    "s": ("time", 1.0), "[ms]": ("time", 1e-3), "µs": ("time", 1e-6), "μs": ("time", 1e-6), "seconds": ("time", 1.0),
    "Second": ("time", 1.0), "(min)": ("time", 60.0),
    "N m": ("torque", 1.0), "N·m": ("torque", 1.0), "N*m": ("torque", 1.0), "Nm": ("torque", 1.0),
    "N-m": ("torque", 1.0), "N.m": ("torque", 1.0), "NM": ("torque", 1.0), "mN m": ("torque", 1e-3),
    "mNm": ("torque", 1e-3), "N mm": ("torque", 1e-3), "kgf m": ("torque", 9.80665), "lbf ft": ("torque", FOOT_POUND),
    "ft-lb": ("torque", FOOT_POUND), "in lbf": ("torque", FOOT_POUND / 12), "oz-in": ("torque", FOOT_POUND / 192),
    "N": ("force", 1.0), "mN": ("force", 1e-3), "lbf": ("force", 4.4482216152605),
    "rad/s": ("rate", 1.0), "rad s^-1": ("rate", 1.0), "rad·s⁻¹": ("rate", 1.0), "deg/s": ("rate", DEG),
    "°/s": ("rate", DEG), "deg/sec": ("rate", DEG), "dps": ("rate", DEG), "degrees per second": ("rate", DEG),
    "rpm": ("rate", math.pi / 30), "1/min": ("rate", math.pi / 30), "rev/s": ("rate", 2 * math.pi),
    "mrad/s": ("rate", 1e-3), "min-1": ("rate", math.pi / 30), "min⁻¹": ("rate", math.pi / 30),
    "min^-1": ("rate", math.pi / 30), "U/min": ("rate", math.pi / 30),
    "tr/min": ("rate", math.pi / 30), "tr/s": ("rate", 2 * math.pi), "Grad/s": ("rate", DEG), "[Grad]": ("angle", DEG),
    "m/s": ("speed", 1.0), "mm/s": ("speed", 1e-3), "rad": ("angle", 1.0), "deg": ("angle", DEG), "°": ("angle", DEG),
    "[Degrees]": ("angle", DEG), "turns": ("angle", 2 * math.pi), "mm": ("length", 1e-3), "A": ("current", 1.0),
    "Volt": ("voltage", 1.0),
}  # fmt: skip


@pytest.mark.parametrize("text", KNOWN)
def test_a_unit_is_known_however_it_is_written(text: str) -> None:
    unit = unit_of(text)
    assert unit is not None
    assert (unit.dimension, pytest.approx(unit.factor, rel=1e-12)) == KNOWN[text]


@pytest.mark.parametrize(
    "text", ["", "filtered", "MN m", "Mrad", "furlong", "grad", "grade", "deg/fortnight", "1", "?", "s/", "raw"]
)
def test_what_is_no_unit_is_none(text: str) -> None:
    assert unit_of(text) is None


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("rate (deg/s)", ("rate", "deg/s")), ("torque [N m]", ("torque", "N m")), ("t/s", ("t", "s")),
        ("ω / (rad/s)", ("ω", "rad/s")), ("Time (s)", ("Time", "s")), ("rate(filtered)", ("rate", "filtered")),
        ("M/Nm", ("M", "Nm")), ("rate_rad_s", ("rate_rad_s", "")), ("rad/s", ("rad/s", "")), ("in/out", ("in/out", "")),
        ("rate[0]", ("rate[0]", "")),
        ("CH(1)", ("CH(1)", "")), ("C1 in V", ("C1", "V")), ("in s", ("", "s")), ("rate in deg/s", ("rate", "deg/s")),
        ("torque in lbf", ("torque in lbf", "")), ("stuck in gear", ("stuck in gear", "")), ("in", ("in", "")),
        ("(s)", ("(s)", "")), ("", ("", "")),
    ],
)  # fmt: skip
def test_a_header_is_parted_into_name_and_unit(header: str, expected: tuple[str, str]) -> None:
    assert name_and_unit(header) == expected
