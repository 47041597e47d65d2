"""Lines over two linear axes as an SVG of a few kilobytes, for the pages of docs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rig.arrays import Array

Line = tuple[str, Array, Array]  # label, x, y
COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e")
WIDTH, LEFT, RIGHT, TOP, BOTTOM = 560, 76, 24, 24, 52
MOST_POINTS = 700


def ticks(low: float, high: float) -> Array:
    """Five or so round numbers between two values."""
    raw = (high - low) / 5
    power = 10 ** math.floor(math.log10(raw))
    step = power * min((1, 2, 5, 10), key=lambda m: abs(m * power - raw))
    return np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step


def panel(
    title: str, x_label: str, y_label: str, lines: Sequence[Line], top: float = 0.0, height: float = 340
) -> list[str]:
    """The elements of one chart whose upper edge lies at ``top``; zero is always in sight on the y axis."""
    xs, ys = np.concatenate([x for _, x, _ in lines]), np.concatenate([y for _, _, y in lines])
    x0, x1 = float(xs.min()), float(xs.max())
    room = 0.06 * float(np.ptp(ys)) if np.ptp(ys) > 0 else 1.0
    y0, y1 = min(float(ys.min()) - room, 0.0), max(float(ys.max()) + room, 0.0)
    upper, lower, right = top + TOP, top + height - BOTTOM, WIDTH - RIGHT

    def px(x: Array | float) -> Array:
        return LEFT + (np.asarray(x) - x0) / (x1 - x0) * (right - LEFT)

    def py(y: Array | float) -> Array:
        return upper + (y1 - np.asarray(y)) / (y1 - y0) * (lower - upper)

    out = []
    for x in ticks(x0, x1):
        out.append(f'<line x1="{px(x):.1f}" y1="{upper}" x2="{px(x):.1f}" y2="{lower}" stroke="#e6e6e6"/>')
        out.append(f'<text x="{px(x):.1f}" y="{lower + 18}" text-anchor="middle">{x:g}</text>')
    for y in ticks(y0, y1):
        out.append(f'<line x1="{LEFT}" y1="{py(y):.1f}" x2="{right}" y2="{py(y):.1f}" stroke="#e6e6e6"/>')
        out.append(f'<text x="{LEFT - 8}" y="{py(y) + 4:.1f}" text-anchor="end">{y:g}</text>')
    for i, (label, x, y) in enumerate(lines):
        thin = max(1, len(x) // MOST_POINTS)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px(x[::thin]), py(y[::thin]), strict=True))
        colour = COLOURS[i % len(COLOURS)]
        out.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6"/>')
        if label:
            place = f'x="{right - 8}" y="{upper + 18 + 18 * i}" text-anchor="end"'
            out.append(
                f'<text {place} fill="{colour}" stroke="white" stroke-width="4" paint-order="stroke">{label}</text>'
            )
    if title:
        out.append(f'<text x="{LEFT}" y="{upper - 7}" font-weight="bold">{title}</text>')
    out.append(f'<text x="{(LEFT + right) / 2}" y="{lower + 38}" text-anchor="middle">{x_label}</text>')
    middle = -(upper + lower) / 2
    out.append(f'<text transform="rotate(-90)" x="{middle}" y="18" text-anchor="middle">{y_label}</text>')
    return out


def svg(elements: Sequence[str], height: float = 340) -> str:
    """Elements as a whole file."""
    font = 'font-family="sans-serif" font-size="13"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:g}" {font}>'
    return "\n".join([head, '<rect width="100%" height="100%" fill="white"/>', *elements, "</svg>", ""])


def stacked(panels: Sequence[tuple[str, Sequence[Line]]], x_label: str, y_label: str, height: float = 200) -> str:
    """Charts below each other, each with its own axes."""
    elements = [
        e for i, (title, lines) in enumerate(panels) for e in panel(title, x_label, y_label, lines, i * height, height)
    ]
    return svg(elements, height * len(panels))
