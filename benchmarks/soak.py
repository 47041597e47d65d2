"""Half an hour on the emulated bench at 1 kHz: does memory grow, does torque drift from what was sent?

    python -m benchmarks.soak [--minutes 30]

`rig play` plays sets of a minute each on devices that `rig emulate` emulates. Once a second the resident memory of
the host is read; afterwards, from its raw capture, every torque that was sent is held against the one that the drive
reports to have applied, set by set, and against the one that the excitation asks for at that instant.
"""

from __future__ import annotations

import argparse
import re
import struct
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.emulated import Devices, Host
from rig.recording.hdf5 import read_recording_h5
from rig.recording.run import Run

SET_S = 60.0
TORQUE_NM, FREQUENCY_HZ = 10.0, 3.0
# A machine that others use stalls within half an hour; what is looked at here is what grows.
PATIENT = (
    "limits.missed_ticks=500", "limits.stale_gyro_ms=500", "bench.amplifier.watchdog_ms=1000",
    "bench.amplifier.settings.drive_heartbeat_ms=1000", "bench.emulator.ports=socket",
)  # fmt: skip


def resident_mb(pid: int) -> float:
    """Resident memory of a process."""
    found = re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    return int(found.group(1)) / 1024.0 if found else float("nan")


def drift_of(run: Run) -> tuple[float, float]:
    """(largest, mean) of what the drive says it applied less what was sent just before, in N m."""
    sent, applied = run.channels.get("sent_torque_nm"), run.channels.get("drive_torque_nm")
    if sent is None or applied is None:
        return float("nan"), float("nan")
    difference = applied[1:] - sent[:-1]
    return float(np.max(np.abs(difference))), float(np.mean(difference))


def asked_less_applied(run: Run) -> float:
    """Root mean square of the recorded torque less the sine that was asked for at its instant, in N m."""
    assert run.torque_time_s is not None and run.torque_nm is not None
    asked = TORQUE_NM * np.sin(2.0 * np.pi * FREQUENCY_HZ * run.torque_time_s)
    inside = (run.torque_time_s > 0.01) & (run.torque_time_s < SET_S - 0.01)
    return float(np.sqrt(np.mean((run.torque_nm - asked)[inside] ** 2)))


def main(given: Sequence[str] | None = None) -> int:
    """Print memory and drift over time; returns 1 where either grew."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=int, default=30)
    arguments = parser.parse_args(given)
    one = f"{{torque_nm: {TORQUE_NM:g}, frequency_hz: {FREQUENCY_HZ:g}, duration_s: {SET_S:g}}}"
    overrides = (f"excitation.sets=[{', '.join([one] * arguments.minutes)}]", "excitation.rest_s=1", *PATIENT)
    memory: list[float] = []
    with tempfile.TemporaryDirectory() as scratch, Devices(overrides) as devices:
        host = Host(devices, Path(scratch) / "run", overrides)
        devices.wait_for(("enabled",), 60.0)
        # Once the drive is off again everything is put together, which takes more.
        while host.process.poll() is None and devices.first(("disabled",), 0.0) is None:
            try:
                memory.append(resident_mb(host.process.pid))
            except (OSError, struct.error):
                break
            time.sleep(1.0)
        code = host.ended(300.0)
        print(f"exit code {code}: {host.said[-300:]}")
        file = Path(scratch) / "run" / "recording.h5"
        runs = read_recording_h5(file).runs if file.exists() else ()
        pauses = [e for e in devices.events if e["event"] == "paused"]
    quarters = [memory[k * (len(memory) - 1) // 4] for k in range(5)]
    print("memory at every quarter, MB: " + ", ".join(f"{m:.0f}" for m in quarters))
    for k, run in enumerate(runs):
        largest, mean = drift_of(run)
        print(
            f"set {k + 1}: {len(run.time_s)} samples, {int((~run.valid).sum())} invalid; drive less sent "
            f"{largest:.3g} N m at most, {mean:+.2g} in the mean; recorded less asked {asked_less_applied(run):.3g} rms"
        )
    print(f"{len(pauses)} pauses of the emulators beyond 5 ms")
    return 0 if code == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
