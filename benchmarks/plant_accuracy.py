"""How exact the simulated motion is: error of the rate against far finer steps, as a table and a figure.

python -m benchmarks.plant_accuracy docs/figures/plant_accuracy.svg
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from rig.excitation import Sine
from rig.platform import Platform
from sim_backend.accuracy import played_rate
from sim_backend.plant import Plant

PARTS = (1, 2, 4, 8, 16, 32)
REFERENCE_PARTS = 256
NOISE_DEG_S = 0.05
SINE = Sine(torque_nm=40, frequency_hz=9, duration_s=10)
CASES: dict[str, tuple[Platform, bool]] = {
    "linear": (Platform(), False),
    "linear, torque held": (Platform(), True),
    "Coulomb 1.2 N m": (Platform(effects={"coulomb_friction": {"level": 1.2}}), False),
    "Stribeck 3.2 / 5.0 N m, 0.08 rad/s": (
        Platform(effects={"stribeck_friction": {"coulomb": 3.2, "static": 5.0, "speed": 0.08}}),
        False,
    ),
}
COLOURS = ("#1f77b4", "#17becf", "#d62728", "#2ca02c")
WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 760, 420, 80, 30, 250, 60
DECADES = (-8, 1)


def errors_deg_s(platform: Platform, held: bool) -> list[float]:
    """Largest rate error in deg/s for each number of fine steps a millisecond."""
    fine = played_rate(platform, SINE, REFERENCE_PARTS, held=held)
    return [math.degrees(float(np.abs(played_rate(platform, SINE, parts, held=held) - fine).max())) for parts in PARTS]


def table(found: dict[str, list[float]]) -> str:
    """The errors as a markdown table."""
    head = "| fine steps a millisecond | " + " | ".join(str(p) for p in PARTS) + " |"
    rows = [f"| {name} | " + " | ".join(f"{e:.1e}" for e in row) + " |" for name, row in found.items()]
    return "\n".join([head, "|---" * (len(PARTS) + 1) + "|", *rows])


def _x(parts: float) -> float:
    return LEFT + math.log2(parts) / math.log2(PARTS[-1]) * (WIDTH - LEFT - RIGHT)


def _y(error: float) -> float:
    low, high = DECADES
    return TOP + (high - math.log10(error)) / (high - low) * (HEIGHT - TOP - BOTTOM)


def svg(found: dict[str, list[float]], played_parts: int) -> str:
    """The errors as a picture, both axes logarithmic."""
    text = 'font-family="sans-serif" font-size="13"'
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" {text}>',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for decade in range(DECADES[0], DECADES[1] + 1):
        y = _y(10.0**decade)
        out.append(f'<line x1="{LEFT}" y1="{y}" x2="{WIDTH - RIGHT}" y2="{y}" stroke="#e0e0e0"/>')
        out.append(f'<text x="{LEFT - 8}" y="{y + 4}" text-anchor="end">1e{decade}</text>')
    for parts in PARTS:
        label = f"{parts} (played)" if parts == played_parts else str(parts)
        out.append(f'<text x="{_x(parts)}" y="{HEIGHT - BOTTOM + 20}" text-anchor="middle">{label}</text>')
    y = _y(NOISE_DEG_S)
    out.append(f'<line x1="{LEFT}" y1="{y}" x2="{WIDTH - RIGHT}" y2="{y}" stroke="black" stroke-dasharray="4"/>')
    out.append(f'<text x="{WIDTH - RIGHT + 8}" y="{y + 4}">noise of one gyro sample</text>')
    for (name, row), colour in zip(found.items(), COLOURS, strict=True):
        points = " ".join(f"{_x(p):.1f},{_y(e):.1f}" for p, e in zip(PARTS, row, strict=True))
        dash = ' stroke-dasharray="6 4"' if "held" in name else ""
        out.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"{dash}/>')
    for i, (name, colour) in enumerate(zip(found, COLOURS, strict=True)):
        y = HEIGHT - BOTTOM - 90 + 22 * i
        out.append(f'<text x="{WIDTH - RIGHT + 8}" y="{y}" fill="{colour}">{name}</text>')
    middle = LEFT + (WIDTH - LEFT - RIGHT) / 2
    out.append(f'<text x="{middle}" y="{HEIGHT - 12}" text-anchor="middle">fine steps a millisecond</text>')
    out.append(
        f'<text x="{-HEIGHT / 2 + 20}" y="22" transform="rotate(-90)" text-anchor="middle">'
        "largest rate error in 10 s, deg/s</text>"
    )
    return "\n".join([*out, "</svg>", ""])


def main() -> None:
    """Print the table; write the figure where a path is given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("figure", nargs="?", type=Path, help="SVG file to write")
    figure: Path | None = parser.parse_args().figure
    found = {name: errors_deg_s(platform, held) for name, (platform, held) in CASES.items()}
    print(table(found))
    if figure is not None:
        figure.write_text(svg(found, Plant(Platform(), 1e-3).parts), encoding="utf-8")


if __name__ == "__main__":
    main()
