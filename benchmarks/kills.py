"""kill -9 at random moments of a run: is the torque off every time, and is every recording there?

    python -m benchmarks.kills [--times 200] [--jobs 2]

`rig play` plays on devices that `rig emulate` emulates; at a random moment between the start of the host and the end
of its campaign it is killed. A kill passes where the emulated drive is at zero torque within 120 ms (the heartbeat
time and 20 ms), and where the files of the run hold all but the last 100 ms of what was played by then.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import json
import math
import random
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.emulated import Devices, Host, Recovered, recovered
from drivers.capture.wire_capture import FILE_NAME

SET_S = 1.5
SHORT = (
    f"excitation.sets=[{{torque_nm: 60, frequency_hz: 3, duration_s: {SET_S:g}}}, "
    f"{{torque_nm: 30, frequency_hz: 6, duration_s: {SET_S:g}}}]",
    "excitation.rest_s=0.3", "bench.settle_s=1", "bench.emulator.start_up_s=0.1", "bench.emulator.ports=socket",
)  # fmt: skip
LONGEST_S = 4.8  # from enabled to the end of the campaign
WATCHDOG_S, LOST_S = 0.120, 0.100
ATTEMPTS = 4


class Kill(NamedTuple):
    """One of them; times in s, NaN where there was no torque or no sample yet."""

    zero_s: float
    lost_s: float
    was_on: bool
    wrong: str


def one_kill(after_s: float, folder: Path) -> Kill:
    """Kill so long after the drive was enabled (negative: before); sooner where it had ended by itself."""
    for attempt in range(ATTEMPTS):
        kill = _try(after_s * 0.7**attempt, folder.with_name(f"{folder.name}-{attempt}"))
        if kill is not None:
            return kill
    return Kill(math.nan, math.nan, False, "it always ended before it could be killed")


def _try(after_s: float, folder: Path) -> Kill | None:
    with Devices(SHORT) as devices:
        host = Host(devices, folder, SHORT)
        if after_s < 0.0:
            time.sleep(-after_s)
        elif devices.wait_for(("enabled",), 30.0) is None:
            host.process.kill()
            return None
        else:
            time.sleep(after_s)
        if host.process.poll() is not None:
            return None
        at_s = host.send(signal.SIGKILL)
        host.process.wait()
        time.sleep(0.35)
        return _judged(devices, host, at_s, recovered(folder) if (folder / "raw" / FILE_NAME).exists() else None)


def _judged(devices: Devices, host: Host, at_s: float, found: Recovered | None) -> Kill:
    told = [e for e in devices.events if "torque_nm" in e and e["event"] != "paused"]
    states = [e["event"] for e in told if e["event"] in ("enabled", "disabled", "watchdog", "fault")]
    off = [e["time_s"] - at_s for e in told if e["event"] in ("watchdog", "fault", "disabled") and e["time_s"] >= at_s]
    zero_s = min(off) if off else math.nan
    wrong, lost_s = [], math.nan
    if (told and told[-1]["torque_nm"][1] != 0.0) or (states and states[-1] == "enabled"):
        wrong.append("the drive is still enabled")
    if zero_s > WATCHDOG_S:
        wrong.append(f"off after {zero_s * 1e3:.0f} ms")
    if found is not None and found.problem:
        wrong.append(found.problem)
    # A drive that was off before had been told so: nothing was recorded any more, and nothing is lost.
    if found is not None and found.last_tick_s is not None and not math.isnan(zero_s):
        last_s = found.last_tick_s
        if found.in_set:
            last_s = min(last_s, found.last_sample_s) if found.last_sample_s is not None else last_s
        lost_s = at_s - last_s
    if lost_s > LOST_S:
        wrong.append(f"{lost_s * 1e3:.0f} ms lost")
    if host.left_over():
        wrong.append("left running")
    return Kill(zero_s, lost_s, "enabled" in states, "; ".join(wrong))


def main(given: Sequence[str] | None = None) -> int:
    """Print what came of all kills; returns how many did not pass."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--times", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="where every kill is kept, so that an interrupted call goes on")
    arguments = parser.parse_args(given)
    moments = random.Random(arguments.seed)
    kills: list[Kill] = []
    if arguments.keep is not None and arguments.keep.exists():
        kills = [Kill(**json.loads(line)) for line in arguments.keep.read_text(encoding="utf-8").splitlines()]
    done = len(kills)
    with (
        tempfile.TemporaryDirectory() as scratch,
        concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool,
    ):
        at = [moments.uniform(-3.0 if k % 10 == 0 else 0.0, 0.0 if k % 10 == 0 else LONGEST_S)
              for k in range(arguments.times)]  # fmt: skip
        waiting = [pool.submit(one_kill, after_s, Path(scratch) / str(k)) for k, after_s in enumerate(at) if k >= done]
        for number, future in enumerate(concurrent.futures.as_completed(waiting), 1):
            kills.append(future.result())
            if arguments.keep is not None:
                with arguments.keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(kills[-1]._asdict()) + "\n")
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
