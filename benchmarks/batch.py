"""identify-batch with two workers against one: are the rows the same, and what is gained?

    python -m benchmarks.batch [--campaigns 8] [--changes]

Short campaigns are played on the simulated rig and identified twice, by one worker and by two. With --changes no
campaign is identified: series of normal numbers show how often the rule for changes in the page of trends finds one
where there is none, and how often it finds a jump of six standard deviations in the middle at its place.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identify.report.trend.change_points import levels

PROGRAMS = Path(sys.executable).parent
CAMPAIGN = """
name: batch
backend: simulated
simulated: {platform: {effects: {coulomb_friction: {level_nm: 0.4}}}}
excitation:
  rest_s: 1.5
  sets:
    - {torque_nm: 20, frequency_hz: 5, duration_s: 2}
    - {torque_nm: 20, frequency_hz: 8, duration_s: 2}
"""
LENGTHS = (6, 8, 10, 20, 50, 100)
SERIES = 1000
JUMP = 6.0  # standard deviations of a campaign about its level


def play(folder: Path, count: int) -> None:
    """Campaigns that differ by their seed."""
    config = folder / "rig.yaml"
    config.write_text(CAMPAIGN, encoding="utf-8")
    for seed in range(1, count + 1):
        call("rig", "play", config, "--out", folder / f"c{seed:03d}", "--seed", seed, "--quiet")


def call(program: str, *words: object) -> None:
    """One of this program's commands. Raises CalledProcessError where it does not end with 0."""
    subprocess.run([str(PROGRAMS / program), *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def timed(folder: Path, workers: int) -> tuple[float, float, list[dict[str, Any]]]:
    """Seconds from start to end of the command, seconds of processor time in it, and the rows without their seconds."""
    import pyarrow.parquet as pq  # noqa: PLC0415 (an extra)

    table = folder / f"{workers}.parquet"
    before, started = os.times(), time.perf_counter()
    call("identify-batch", f"{folder}/c*", "--out", table, "--workers", workers, "--quiet")
    took_s = time.perf_counter() - started
    after = os.times()
    busy_s = after.children_user + after.children_system - before.children_user - before.children_system
    return took_s, busy_s, pq.read_table(table).drop(["seconds"]).to_pylist()


def changes() -> None:
    """False alarms and jumps found, in percent of the series, by length and by what the campaigns scatter by."""
    print("campaigns  false alarms, %          jumps found at their place, %")
    print("           intervals   3 x that     intervals   3 x that")
    for length in LENGTHS:
        rng, shares = np.random.default_rng(length), []
        jump = JUMP * (np.arange(length) >= length // 2)
        for moved in (0.0 * jump, jump):
            for scatter in (1.0, 10.0**0.5):
                cuts = [
                    [one.first for one in levels(scatter * (rng.standard_normal(length) + moved), np.ones(length))]
                    for _ in range(SERIES)
                ]
                hits = [len(c) > 1 for c in cuts] if not moved.any() else [c == [0, length // 2] for c in cuts]
                shares.append(100.0 * sum(hits) / SERIES)
        print(f"{length:9d}  {shares[0]:9.1f}  {shares[1]:9.1f}     {shares[2]:9.1f}  {shares[3]:9.1f}")


def main(given: Sequence[str] | None = None) -> int:
    """Print seconds and whether the rows agree; returns 1 where they do not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=8)
    parser.add_argument("--changes", action="store_true", help="the rule for changes, without any campaign")
    arguments = parser.parse_args(given)
    if arguments.changes:
        changes()
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        play(folder, arguments.campaigns)
        timed_by = {workers: timed(folder, workers) for workers in (1, 2)}
    (one_s, one_busy_s, one), (two_s, two_busy_s, two) = timed_by[1], timed_by[2]
    same = one == two
    speed = f"one worker {one_s:.1f} s, two {two_s:.1f} s, {one_s / two_s:.2f} times as fast"
    print(f"{arguments.campaigns} campaigns: {speed}")
    print(f"processor time {one_busy_s:.1f} s, {two_busy_s:.1f} s (what counts on a machine that is busy otherwise)")
    print(f"rows identical: {'yes' if same else 'NO'}")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
