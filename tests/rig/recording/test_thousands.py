"""A sign between thousands is not read as a decimal sign, and three decimals are not taken for thousands."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.rig.recording.support import motion, read, refusal

TORQUE = np.rint(700 * motion()["torque_nm"]).astype(int)  # -2100 to 2100


def with_commas(n: int) -> str:
    return f'"{n:,}"'


def with_points(n: int) -> str:
    return f"{n:,}".replace(",", ".")


def text_of(torque: Callable[[int], str], delimiter: str) -> str:
    lines = [f"time_s{delimiter}torque_nm{delimiter}rate_rad_s"]
    columns = motion()["time_s"], TORQUE, motion()["rate_rad_s"]
    lines += [f"{t:.3f}{delimiter}{torque(int(u))}{delimiter}{w:.6f}" for t, u, w in zip(*columns, strict=True)]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("torque", "delimiter", "words"),
    [
        (with_commas, ";", "no sign between thousands"),
        (with_points, ";", "beside whole numbers such as '999'"),
        (with_points, ",", "the point stands between thousands"),
    ],
)
def test_a_sign_between_thousands_is_refused_with_the_cure(
    torque: Callable[[int], str], delimiter: str, words: str, tmp_path: Path
) -> None:
    (tmp_path / "r.csv").write_text(text_of(torque, delimiter))
    message = refusal(tmp_path, "r.csv")
    assert "column 'torque_nm'" in message and "between thousands" in message
    assert words.replace("'999'", f"'{max((n for n in TORQUE if abs(n) < 1000), key=abs)}'") in message


def test_commas_between_thousands_of_whole_numbers_alone_are_refused_too(tmp_path: Path) -> None:
    rows = [f'"{i:,}","{u:,}","{r:,}"' for i, (u, r) in enumerate(zip(TORQUE, TORQUE[::-1], strict=True))]
    (tmp_path / "r.csv").write_text("time_s,torque_nm,rate_rad_s\n" + "\n".join(rows) + "\n")
    message = refusal(tmp_path, "r.csv", "  scale: {time: 0.001}\n")
    assert "the comma stands between thousands" in message


def test_thousands_of_a_rate_that_hardly_rests_below_a_thousand_are_seen(tmp_path: Path) -> None:
    lines = [f'{t:.3f},{u},"{round(9e4 * w):,}"' for t, u, w in zip(*list(motion().values())[:3], strict=True)]
    lines[100] = lines[100].split(",")[0] + ',1,"512"'
    (tmp_path / "r.csv").write_text("time_s,torque_nm,rate_rad_s\n" + "\n".join(lines) + "\n")
    assert "column 'rate_rad_s'" in refusal(tmp_path, "r.csv")


@pytest.mark.parametrize(
    "torque",
    [
        lambda n: f"{n / 1000:.3f}",
        lambda n: f"{n / 1000:g}",
        lambda n: f"{150 + n / 1000:g}",
        lambda n: f"{150 + n / 1000:.3f}",
        lambda n: f"{n / 100:g}",
        str,
    ],
)
def test_decimals_are_read_as_they_are(torque: Callable[[int], str], tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(text_of(torque, ","))
    found = read(tmp_path, "r.csv").runs[0].torque_nm
    assert found is not None
    np.testing.assert_array_equal(found, [float(torque(int(n))) for n in TORQUE])
