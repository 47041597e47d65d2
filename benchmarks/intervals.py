"""How often the 95 % intervals hold the truth, over simulated campaigns.

python -m benchmarks.intervals --white 500 --lost 200 --real 200 --gyro GYRO.npz

White noise; white noise with 2 % of the samples lost; and, if --gyro is given, the noise of a real gyro at rest,
scaled to 0.05 deg/s, each of its samples used as one of 1 kHz. Intervals are those of the final fit, noise estimated
from the data.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.campaigns import (
    SIGMA_RAD_S,
    TRUTH,
    clean_rates,
    regression_start,
    structure_with,
    times,
    traces_from,
    white,
)
from identify.estimate.final_fit import by_output_error
from identify.estimate.starting_point import horizon_s
from rig.arrays import Array

GYRO_ARRAY = "gyro_counts"
LOST_SHARE = 0.02
Z95 = 1.96
Noise = Callable[[np.random.Generator], list[Array]]


@dataclass(frozen=True)
class Coverage:
    """Share of intervals that hold the truth, by parameter, and the spread of the errors over their claimed size."""

    kind: str
    runs: int
    inside: dict[str, float]
    spread: dict[str, float]  # root mean square of error over standard error: 1 where intervals are true

    @property
    def overall(self) -> float:
        """Share over all parameters."""
        return float(np.mean(list(self.inside.values())))


def gyro_noise(path: Path) -> Noise:
    """Stretches of a real gyro's record, rescaled as one to the standard deviation of the white noise.

    The file holds an array ``gyro_counts`` of shape (samples, axes), recorded at rest and longer than a set.

    Raises
    ------
    ValueError
        Where it does not.
    """
    with np.load(path) as file:
        if GYRO_ARRAY not in file:
            raise ValueError(f"{path} has no array {GYRO_ARRAY}: save the gyro's samples at rest under that name")
        counts = file[GYRO_ARRAY].astype(float)
    n = len(times())
    if counts.ndim != 2 or len(counts) <= n:
        raise ValueError(f"{path}: {GYRO_ARRAY} has shape {counts.shape}, needed is (more than {n} samples, axes)")
    scaled = SIGMA_RAD_S * (counts - counts.mean(axis=0)) / counts.std(axis=0)

    def draw(rng: np.random.Generator) -> list[Array]:
        starts = rng.integers(0, len(scaled) - n, len(clean_rates()))
        return [scaled[s : s + n, rng.integers(0, scaled.shape[1])] for s in starts]

    return draw


def lost_samples(rng: np.random.Generator, count: int) -> list[Array]:
    """Which samples are lost, one array a set; the first and the last arrive."""
    out = []
    for _ in range(count):
        lost = rng.random(len(times())) < LOST_SHARE
        lost[[0, -1]] = False
        out.append(lost)
    return out


def measure(kind: str, noise: Noise, runs: int, lost: bool, seed: int = 0) -> Coverage:
    """Fit ``runs`` campaigns and count."""
    rates = clean_rates()
    structure = structure_with(False)
    z = []
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        drawn = noise(rng)
        traces = traces_from(rates, drawn, lost_samples(rng, len(rates)) if lost else None, None)
        start = regression_start(traces, structure)
        use = [t.keep for t in traces]
        platform = tuple(start[(name,)] for name in TRUTH)
        found = by_output_error(traces, structure, start, horizon_s(platform, traces), use, use)  # type: ignore[arg-type]
        z.append([(found.values[(n,)] - v) / found.std_error((n,)) for n, v in TRUTH.items()])
    size = np.abs(np.array(z))
    names = list(TRUTH)
    inside = dict(zip(names, np.mean(size < Z95, axis=0).tolist(), strict=True))
    return Coverage(kind, runs, inside, dict(zip(names, np.sqrt(np.mean(size**2, axis=0)).tolist(), strict=True)))


def text(found: Sequence[Coverage]) -> str:
    """A markdown table."""
    lines = [
        "| noise | campaigns | J % | C % | K % | all % | error over standard error, J, C, K |",
        "|---|---|---|---|---|---|---|",
    ]
    for c in found:
        shares = " | ".join(f"{100 * v:.1f}" for v in (*c.inside.values(), c.overall))
        lines.append(f"| {c.kind} | {c.runs} | {shares} | {', '.join(f'{v:.3f}' for v in c.spread.values())} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table, a row as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, runs in (("white", 500), ("real", 200), ("lost", 200)):
        parser.add_argument(f"--{name}", type=int, default=runs)
    parser.add_argument("--gyro", type=Path, help=f"NPZ file with {GYRO_ARRAY}: a gyro at rest, shape (samples, axes)")
    given = parser.parse_args()
    found = []
    with threadpool_limits(1):
        if given.real and given.gyro:
            found.append(measure("real gyro", gyro_noise(given.gyro), given.real, False))
            print(text(found[-1:]), flush=True)
        if given.lost:
            found.append(measure("white, 2 % lost", white, given.lost, True))
            print(text(found[-1:]), flush=True)
        if given.white:
            found.append(measure("white", white, given.white, False))
    print("\n" + text(found))


if __name__ == "__main__":
    main()
