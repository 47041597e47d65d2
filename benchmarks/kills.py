"""kill -9 at random moments of a run: is the torque off every time, and is every recording there?

    python benchmarks/kills.py [--times 200] [--jobs 2]

`rig play` plays on devices that `rig emulate` emulates; at a random moment between the start of the host and the end
of its campaign it is killed. A kill passes where the emulated drive is at zero torque within 120 ms (the heartbeat
time and 20 ms), and where the files of the run hold all but the last 100 ms of what was played by then.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import math
import random
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.emulated import Devices, Host, recovered

SET_S = 1.5
SHORT = (
    f"excitation.sets=[{{torque_nm: 60, frequency_hz: 3, duration_s: {SET_S:g}}}, "
    f"{{torque_nm: 30, frequency_hz: 6, duration_s: {SET_S:g}}}]",
    "excitation.rest_s=0.3", "bench.settle_s=1", "bench.emulator.start_up_s=0.1", "bench.emulator.ports=socket",
)  # fmt: skip
LONGEST_S = 6.5  # from enabled to the end of the campaign
WATCHDOG_S, LOST_S = 0.120, 0.100


class Kill(NamedTuple):
    """One of them; times in s, NaN where there was no torque or no sample yet."""

    zero_s: float
    lost_s: float
    was_on: bool
    wrong: str


def one_kill(after_s: float, folder: Path) -> Kill:
    """Kill so long after the drive was enabled (negative: before)."""
    with Devices(SHORT) as devices:
        host = Host(devices, folder, SHORT)
        if after_s < 0.0:
            time.sleep(-after_s)
        elif devices.wait_for(("enabled",), 30.0) is None:
            return Kill(math.nan, math.nan, False, f"never enabled: {host.said}")
        else:
            time.sleep(after_s)
        at_s = host.send(signal.SIGKILL) if host.process.poll() is None else math.nan
        host.process.wait()
        time.sleep(0.35)
        return _judged(devices, host, at_s, recovered(folder) if folder.exists() else None)


def _judged(devices: Devices, host: Host, at_s: float, found: object) -> Kill:
    from benchmarks.emulated import Recovered  # noqa: PLC0415  for the type at run time

    told = [e for e in devices.events if "torque_nm" in e and e["event"] != "paused"]
    is_on = bool(told) and told[-1]["torque_nm"][1] != 0.0
    enabled = [e for e in told if e["event"] in ("enabled", "disabled", "watchdog", "fault")]
    was_on = any(e["event"] == "enabled" for e in enabled) and not math.isnan(at_s)
    off = [e["time_s"] - at_s for e in told if e["event"] in ("watchdog", "fault", "disabled") and e["time_s"] >= at_s]
    zero_s = min(off) if off else math.nan
    wrong = []
    still_enabled = bool(enabled) and enabled[-1]["event"] == "enabled"
    if is_on or still_enabled:
        wrong.append("the drive is still enabled")
    if not math.isnan(zero_s) and zero_s > WATCHDOG_S:
        wrong.append(f"off after {zero_s * 1e3:.0f} ms")
    lost_s = math.nan
    if isinstance(found, Recovered):
        if found.problem:
            wrong.append(found.problem)
        if found.last_tick_s is not None and not math.isnan(at_s):
            lost_s = at_s - found.last_tick_s
            if found.last_sample_s is not None and abs(found.last_sample_s - at_s) < SET_S:
                lost_s = max(lost_s, at_s - found.last_sample_s)
    if host.left_over():
        wrong.append("left running")
    return Kill(zero_s, lost_s, was_on, "; ".join(wrong))


def main(given: Sequence[str] | None = None) -> int:
    """Print what came of all kills; returns how many did not pass."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--times", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(given)
    moments = random.Random(arguments.seed)
    kills: list[Kill] = []
    with (
        tempfile.TemporaryDirectory() as scratch,
        concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool,
    ):
        at = [moments.uniform(-3.0 if k % 10 == 0 else 0.0, 0.0 if k % 10 == 0 else LONGEST_S)
              for k in range(arguments.times)]  # fmt: skip
        waiting = [pool.submit(one_kill, after_s, Path(scratch) / str(k)) for k, after_s in enumerate(at)]
        for number, future in enumerate(concurrent.futures.as_completed(waiting), 1):
            kills.append(future.result())
            if kills[-1].wrong or number % 20 == 0:
                print(f"{number}/{arguments.times} {kills[-1].wrong}", flush=True)
    print(summary(kills))
    return sum(bool(kill.wrong) for kill in kills)


def summary(kills: Sequence[Kill]) -> str:
    """All of it in four lines."""
    zero = sorted(k.zero_s * 1e3 for k in kills if not math.isnan(k.zero_s))
    lost = sorted(k.lost_s * 1e3 for k in kills if not math.isnan(k.lost_s))
    late = [ms for ms in lost if ms > LOST_S * 1e3]
    lines = [f"{len(kills)} kills, {sum(k.was_on for k in kills)} while the drive was or had been enabled"]
    if zero:
        lines.append(f"drive off after {zero[len(zero) // 2]:.0f} ms (median), {zero[-1]:.0f} ms (most) in {len(zero)}")
    if lost:
        lines.append(f"lost {lost[len(lost) // 2]:.0f} ms (median), {lost[-1]:.0f} ms (most), {len(late)} above 100 ms")
    return "\n".join([*lines, f"{sum(bool(k.wrong) for k in kills)} did not pass"])


if __name__ == "__main__":
    sys.exit(min(main(), 1))
