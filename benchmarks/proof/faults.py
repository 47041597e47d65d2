"""What happens when something fails in the middle of a proof: twenty of the faults of docs/safety.md.

    python -m benchmarks.proof.faults [--times 1] [--jobs 1] [FAULT ...]

A campaign with a hidden Coulomb friction is played on emulated devices and identified once. For each try `rig prove`
plays the proof of a copy of it on devices that `rig emulate` emulates, and in the set with compensation something is
done to either. A try passes where it would in `benchmarks.faults`, and where in addition

- every file of the campaign but recording.h5, result.json and the report is as it was,
- recording.h5 can be read and holds every sample of the campaign.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import hashlib
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.emulated import CONFIG, SET_S, SHORT, TO_THE_SET_S, Devices, Host, ports_of, recovered
from benchmarks.fault_cases import CASES, Case
from benchmarks.faults import ATTEMPTS, HEAD, Outcome, judged, moment_s, never_on, row
from rig.recording.hdf5 import read_recording_h5, write_recording_h5

FAULTS = (
    "gyro_unplugged", "gyro_silent", "gyro_garbled", "gyro_stuck", "gyro_reversed", "gyro_loose", "gyro_jump",
    "gyro_saturated", "adapter_unplugged", "adapter_stalls", "bus_off", "drive_emergency", "drive_reset", "drive_off",
    "torque_runs_away", "torque_doubled", "torque_stuck", "kill -9", "exception in the loop", "Ctrl-C",
)  # fmt: skip
REST_S = 1.5  # in which 1 N m of friction stops the platform after a set
HIDDEN = "{coulomb_friction: {level_nm: 1.0}}"
PLAYED = (*SHORT, f"excitation.rest_s={REST_S:g}", f"simulated.platform.effects={HIDDEN}")
DECLARED = (f"model.effects={HIDDEN}", "identify.candidates=[]")
FIRST_DONE = "set 1/2"  # is said when it has been played
ENDS_S = 120.0  # the report is written too
PART = "proof"
NEW_FILES = ("result.json", "report.html", "report_data.h5", "model.yaml", "summary.txt", "recording.h5")


@dataclass
class ProofHost(Host):
    """`rig prove`, on the devices that the folder's recording names."""

    def line(self) -> list[str]:
        """What follows `rig`."""
        return ["prove", str(self.folder), "--yes"]


def identified(folder: Path) -> None:
    """A campaign of one set on emulated devices, and its identification."""
    line = [str(Path(sys.executable).with_name("identify-run")), CONFIG, "--emulate", "--yes", "--quiet"]
    for override in (
        *SHORT,
        f"simulated.platform.effects={HIDDEN}",
        f"model.effects={HIDDEN}",
        "identify.candidates=[]",
    ):
        line += ["--set", override]
    for _ in range(ATTEMPTS):
        done = subprocess.run([*line, "--out", str(folder)], capture_output=True, text=True, check=False)
        if done.returncode in (0, 1):
            return
        shutil.rmtree(folder, ignore_errors=True)
    raise SystemExit(f"no campaign was identified: {done.stderr}")


def played_on(folder: Path, devices: Devices) -> None:
    """Let the recording of a folder say that it was made on these devices."""
    path = folder / "recording.h5"
    recording = read_recording_h5(path)
    overrides = [*recording.info["config_overrides"], *ports_of(devices)]
    path.unlink()
    write_recording_h5(
        path, replace(recording, info={**recording.info, "config_overrides": overrides, "played_on": "bench"})
    )


def one_try(case: Case, after_s: float, campaign: Path, folder: Path) -> Outcome:
    """Prove a copy of the campaign, let it fail so long into the set with compensation, and look at what came of it."""
    shutil.copytree(campaign, folder)
    before = _digests(folder)
    with Devices(PLAYED) as devices:
        played_on(folder, devices)
        host = ProofHost(devices, folder, terminal=case.terminal(), results=folder.with_suffix(".out"))
        if devices.wait_for(("enabled",), ENDS_S) is None:
            host.ended(1.0)
            return never_on(f"the drive was never enabled: {host.said}")
        end_s = time.monotonic() + TO_THE_SET_S + 2.0 * REST_S + 2.0 * SET_S
        while FIRST_DONE not in host.said and time.monotonic() < end_s:
            time.sleep(0.05)
        devices.wait_for(("nothing",), REST_S + after_s)
        fault_s = case.strike(devices, host)
        code = host.ended(ENDS_S)
        devices.wait_for(("nothing",), 0.4)  # until the drive's own watchdog has had its time
        outcome = judged(case, devices, host, code, fault_s, recovered(folder, PART))
    lost = [name for name, digest in before.items() if _digests(folder).get(name) != digest]
    wrong = [f"{name} is not as it was" for name in lost] + _missing(campaign, folder)
    return outcome._replace(wrong=(*outcome.wrong, *wrong))


def _digests(folder: Path) -> dict[str, str]:
    """Of every file that no proof writes anew."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in NEW_FILES
    }  # fmt: skip


def _missing(campaign: Path, folder: Path) -> list[str]:
    """What of the campaign's runs is not in the recording."""
    now, before = (
        {run.name: np.asarray(run.rate_rad_s) for run in read_recording_h5(at / "recording.h5").runs}
        for at in (folder, campaign)
    )
    return [
        f"run {name} is not in recording.h5 as it was" for name, rate in before.items()
        if name not in now or not np.array_equal(rate, now[name], equal_nan=True)
    ]  # fmt: skip


def undisturbed(case: Case, after_s: float, campaign: Path, folder: Path) -> Outcome:
    """One try; again where this machine stalled by itself, which is another fault than the one looked at."""
    for attempt in range(ATTEMPTS):
        outcome = one_try(case, after_s, campaign, folder.with_name(f"{folder.name}-{attempt}"))
        if not outcome.disturbed:
            break
    return outcome


def main(given: Sequence[str] | None = None) -> int:
    """Print a row for every fault; returns how many failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("faults", nargs="*", default=FAULTS)
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(given)
    cases = [case for case in CASES if case.name in arguments.faults and not case.before]
    failed = 0
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        campaign = Path(scratch) / "campaign"
        identified(campaign)
        print(HEAD, flush=True)

        def tries(case: Case) -> list[Outcome]:
            moments_s = [moment_s(arguments.seed, case.name, k) for k in range(arguments.times)]
            name = case.name.replace(" ", "_")
            return [undisturbed(case, at, campaign, Path(scratch) / f"{name}-{k}") for k, at in enumerate(moments_s)]

        for case, outcomes in zip(cases, pool.map(tries, cases), strict=True):
            print(row(case, outcomes), flush=True)
            failed += any(outcome.wrong for outcome in outcomes)
    print(f"{len(cases)} faults, {arguments.times * len(cases)} tries, {failed} faults failed")
    return failed


if __name__ == "__main__":
    sys.exit(min(main(), 1))
