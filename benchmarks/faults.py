"""What happens when something fails: each fault of the emulators, at random moments, as the emulated drive saw it.

    python benchmarks/faults.py [--times 3] [FAULT ...]

A campaign is played on the emulated bench by `rig play` in a process of its own; some way into the set the fault
takes hold. From the drive's own events comes the time from there to zero torque.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rig.recording.hdf5 import read_recording_h5
from sim_backend.emulators.fault_kinds import FAULTS

SET_S = 4.0
QUIET = (
    f"excitation.sets=[{{torque_nm: 40, frequency_hz: 3, duration_s: {SET_S:g}}}]", "excitation.rest_s=0",
    "bench.settle_s=1.5", "bench.emulator.start_up_s=0.1",
)  # fmt: skip
OFF = ("torque_zero", "watchdog", "fault", "disabled")


class Outcome(NamedTuple):
    """Of one try; times in s, None where the fault never took hold or the torque never went off before the end."""

    code: int
    zero_after_s: float | None
    said: str


def one_try(fault: str, after_s: float, folder: Path) -> Outcome:
    """Play with a fault that takes hold so long after the drive was enabled."""
    injected = json.dumps([{"fault": fault, "after_s": after_s}])
    line = [sys.executable, "-c", "from rig.cli import main; main()", "play", "examples/bench.yaml", "--emulate"]
    line += ["--quiet", "--out", str(folder)]
    for override in (*QUIET, f"bench.emulator.faults={injected}"):
        line += ["--set", override]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60, check=False)
    events: Sequence[dict[str, Any]] = ()
    if (folder / "recording.h5").exists():
        events = read_recording_h5(folder / "recording.h5").info.get("emulated_drive", ())
    begun = next((e["time_s"] for e in events if e["event"] == "injected"), None)
    zero = None
    if begun is not None:
        zero = next((e["time_s"] for e in events if e["event"] in OFF and e["time_s"] >= begun), None)
    said = " ".join(done.stderr.split())
    return Outcome(done.returncode, None if begun is None or zero is None else zero - begun, said)


def main(given: Sequence[str] | None = None) -> None:
    """Print a row for every fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("faults", nargs="*", default=list(FAULTS))
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(given)
    moments = random.Random(arguments.seed)
    print(f"{'fault':20s} {'exit':>9s}  {'ms to zero torque (each)':28s} what was said")
    for fault in arguments.faults:
        with tempfile.TemporaryDirectory() as scratch:
            tries = [
                one_try(fault, moments.uniform(0.8, 0.5 + 0.8 * SET_S), Path(scratch) / str(k))
                for k in range(arguments.times)
            ]
        codes = "/".join(str(code) for code in sorted({t.code for t in tries}))
        times = ", ".join("-" if t.zero_after_s is None else f"{1e3 * t.zero_after_s:.0f}" for t in tries)
        print(f"{fault:20s} {codes:>9s}  {times:28s} {tries[0].said[:150]}", flush=True)


if __name__ == "__main__":
    main()
