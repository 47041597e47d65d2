"""Mutated recordings of every format, raw captures, object dictionaries: each is read or refused, within bounds.

    python -m benchmarks.fuzz_recordings [--count 10000] [--seed 1] [FORMAT ...]

Files are made by code, then bytes are changed, cut out, put in or cut off. Beside them stand files that are made to
do harm: bombs of gzip, zip and zlib, pickles, huge declared shapes, links and datasets that lead elsewhere. A batch
runs in a process of its own with a limit on its memory, so that a crash of a library is seen too.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.fuzz import files
from rig.config.load import load_config
from rig.errors import ConfigError, DeviceFault, RecordingError
from rig.recording.load import read_recording

LONGEST_S = 20.0  # of this process' own time
MOST_MEMORY_BYTES = 6 << 30  # of addresses; what is really used is said at the end
BATCH = 250
HANG_S = 600.0  # of a batch, which a library that hangs would keep for ever


def read_as_recording(path: Path) -> None:
    """As a run of a `recorded` section."""
    yaml = path.with_name("rig.yaml")
    names = (
        "columns: {time: log.time_s, torque: log.torque_nm, rate: log.rate_rad_s}, " if "struct" in path.name else ""
    )
    yaml.write_text(f"backend: recorded\nrecorded: {{{names}runs: [{{file: {path.name}}}]}}\n")
    for run in read_recording(load_config(yaml)).runs:
        assert np.isfinite(run.time_s).all() and len(run.time_s) >= 20


def read_as_eds(path: Path) -> None:
    """As the object dictionary of a drive, and the plan that follows from it."""
    from drivers.amplifiers.canopen_node import read_dictionary  # noqa: PLC0415  only where it is asked for
    from drivers.amplifiers.cia402_plan import plan_drive  # noqa: PLC0415

    plan_drive(read_dictionary(path, 1), "auto", None, True, True)


def read_as_capture(path: Path) -> None:
    """As a raw capture, replayed through the drivers."""
    from drivers.capture.account import summary_of  # noqa: PLC0415
    from drivers.replay import ReplayRig  # noqa: PLC0415

    summary_of(path)
    rig = ReplayRig(path)
    rig.open()
    rig.arm()
    for _ in range(20):
        rig.exchange(rig.clock.now_s(), 0.0)


READERS: Mapping[str, Callable[[Path], None]] = {".eds": read_as_eds, ".cap": read_as_capture}


def one(path: Path) -> str:
    """Read one file. Raises whatever is no refusal, and AssertionError where it took too long."""
    begun_s = time.process_time()
    try:
        READERS.get(path.suffix, read_as_recording)(path)
        outcome = "read"
    except (RecordingError, ConfigError, DeviceFault) as refusal:
        assert str(refusal).strip(), "a refusal without words"
        outcome = "refused"
    took_s = time.process_time() - begun_s
    assert took_s < LONGEST_S, f"took {took_s:.1f} s"
    return outcome


def batch(name: str, count: int, seed: int, folder: Path) -> Counter[str]:
    """So many mutations of one format, in this process; the file under test stays in ``folder`` if it crashes."""
    outcomes: Counter[str] = Counter()
    random = np.random.default_rng(seed)
    path = folder / name
    files.MAKERS[name](path)
    original = path.read_bytes()
    for _ in range(count):
        path.write_bytes(files.mutated(original, random))
        try:
            outcomes[one(path)] += 1
        except Exception as error:  # noqa: BLE001  this is what is looked for
            outcomes["BROKE"] += 1
            print(f"BROKE {name}: {type(error).__name__}: {str(error)[:300]}", flush=True)
            keep(path, f"{name}_{seed}_{outcomes.total()}")
    return outcomes


def specials(folder: Path) -> Counter[str]:
    """Every file that is made to do harm; none of them may be read without an objection where it says so."""
    outcomes: Counter[str] = Counter()
    for name, make in files.HARMFUL.items():
        path = folder / name.partition(" ")[2].replace(" ", "_")
        make(path)
        begun_s = time.process_time()
        try:
            outcome = one(path)
            if name.startswith("refuse"):
                assert outcome == "refused", "was read"
            outcomes[outcome] += 1
        except Exception as error:  # noqa: BLE001  as above
            outcomes["BROKE"] += 1
            print(f"BROKE {name}: {type(error).__name__}: {str(error)[:300]}", flush=True)
        print(f"  {name}: {time.process_time() - begun_s:.1f} s", flush=True)
        path.unlink(missing_ok=True)
    return outcomes


def keep(path: Path, name: str) -> None:
    """Put a file that broke a promise where it can be looked at."""
    kept = Path(tempfile.gettempdir()) / "isp_rig_fuzz"
    kept.mkdir(exist_ok=True)
    (kept / f"{name}{path.suffix}").write_bytes(path.read_bytes())


def limited() -> None:
    """In the child: no more memory than this, where the system knows such a limit."""
    if sys.platform != "win32":
        import resource  # noqa: PLC0415  POSIX only

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY_BYTES, MOST_MEMORY_BYTES))


def child(given: argparse.Namespace) -> int:
    """One batch, or the harmful files; prints outcomes and the memory used."""
    limited()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        done = specials(folder) if given.child == "harmful" else batch(given.child, given.count, given.seed, folder)
    used_mb = 0
    if sys.platform != "win32":
        import resource  # noqa: PLC0415

        used_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
    print(f"DONE {done['read']} {done['refused']} {done['BROKE']} {used_mb}")
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for every format; 1 where a promise was broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help=f"of {', '.join(files.MAKERS)} and harmful")
    parser.add_argument("--count", type=int, default=10_000, help="in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--child", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.child:
        return child(given)
    formats = given.formats or [*files.MAKERS, "harmful"]
    each = -(-given.count // len(formats))
    broke = 0
    for name in formats:
        figures, used_mb, begun_s = [0, 0, 0], 0, time.monotonic()
        for k in range(1 if name == "harmful" else -(-each // BATCH)):
            line = [sys.executable, "-m", "benchmarks.fuzz_recordings", "--child", name, "--count",
                    str(min(BATCH, each - k * BATCH)), "--seed", str(given.seed + k)]  # fmt: skip
            try:
                done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=HANG_S)
            except subprocess.TimeoutExpired:
                print(f"BROKE {name}: seed {given.seed + k} hangs")
                figures[2] += 1
                continue
            *said, last = done.stdout.splitlines() or [""]
            sys.stdout.writelines(f"{text}\n" for text in said)
            if not last.startswith("DONE"):
                print(f"BROKE {name}: the process ended with {done.returncode}: {done.stderr[-500:]}")
                figures[2] += 1
                continue
            *counts, memory = (int(n) for n in last.split()[1:])
            figures = [a + b for a, b in zip(figures, counts, strict=True)]
            used_mb = max(used_mb, memory)
        broke += figures[2]
        told = f"{figures[0]:6d} read {figures[1]:6d} refused {figures[2]:4d} broke"
        print(f"{name:18}{told}  {used_mb:5d} MiB {time.monotonic() - begun_s:6.0f} s", flush=True)
    return int(broke > 0)


if __name__ == "__main__":
    sys.exit(main())
