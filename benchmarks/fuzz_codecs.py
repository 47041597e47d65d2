"""Hostile bytes through every codec, guided by coverage; the figures of docs/fuzzing.md come from here.

    pip install 'isp-rig[fuzz]'
    python -m benchmarks.fuzz_codecs [--seconds 1200] [--megabytes 10] [--json FILE] [TARGET ...]

Each target runs in a process of its own until it has had its share of the seconds and its megabytes. What breaks a
promise (an exception, a hang, more than 1 GiB, a packet accepted with a wrong checksum) ends it with the
input that did it. Without atheris (``--plain``) inputs are mutated at random.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

HANG_S, MEMORY_MB, LONGEST_INPUT = 60, 1024, 4096  # a minute on a busy machine is seconds of its own
NAMES = ("stim300", "stim300_text", "vectornav", "kvh1750", "xbus", "lawicel", "odrive", "moteus", "vesc", "cia402",
         "clocks")  # fmt: skip


class Count:
    """How much went through, written down now and then and at the end, when the process stops itself."""

    def __init__(self, target: Callable[[bytes], int], seconds: float, bytes_wanted: int, state: Path) -> None:
        self.target, self.state = target, state
        self.inputs = self.bytes = 0
        self._begun_s, self._seconds, self._wanted = time.monotonic(), seconds, bytes_wanted

    def one(self, data: bytes) -> None:
        """One input."""
        self.bytes += self.target(bytes(data))
        self.inputs += 1
        if self.inputs % 100 == 0 and self._is_enough():
            self.write()
            os._exit(0)

    def _is_enough(self) -> bool:
        return self.bytes >= self._wanted and time.monotonic() - self._begun_s >= self._seconds

    def write(self) -> None:
        """What was done so far."""
        seconds = round(time.monotonic() - self._begun_s, 1)
        self.state.write_text(json.dumps({"inputs": self.inputs, "bytes": self.bytes, "seconds": seconds}))


def guided(name: str, seconds: float, bytes_wanted: int, state: Path) -> None:
    """Run one target under atheris; ends the process."""
    import atheris  # noqa: PLC0415  an optional extra

    with atheris.instrument_imports(include=["drivers"]):
        from benchmarks.fuzz.targets import TARGETS, seeds  # noqa: PLC0415  only instrumented from here on
    corpus = state.parent / f"corpus_{name}"
    corpus.mkdir(exist_ok=True)
    for k, seed in enumerate(seeds(name)):
        (corpus / f"seed_{k}").write_bytes(seed)
    count = Count(TARGETS[name], seconds, bytes_wanted, state)
    options = [f"-max_len={LONGEST_INPUT}", f"-timeout={HANG_S}", f"-rss_limit_mb={MEMORY_MB}", "-len_control=0",
               f"-artifact_prefix={state.parent}/{name}_", "-print_final_stats=1"]  # fmt: skip
    atheris.Setup([sys.argv[0], *options, str(corpus)], count.one)
    atheris.Fuzz()


def plain(name: str, seconds: float, bytes_wanted: int, state: Path, seed: int = 1) -> None:
    """Run one target on inputs mutated at random; ends the process."""
    from benchmarks.fuzz.targets import TARGETS, seeds  # noqa: PLC0415  as above

    count = Count(TARGETS[name], seconds, bytes_wanted, state)
    random = np.random.default_rng(seed)
    begun = seeds(name)
    while True:
        data = mutated(begun[int(random.integers(len(begun)))], random)
        try:
            count.one(data)
        except BaseException:
            (state.parent / f"{name}_crash").write_bytes(data)
            raise


def mutated(data: bytes, random: np.random.Generator, most: int = 12) -> bytes:
    """A few bytes changed, copied, cut out or put in."""
    changed = bytearray(data)
    for _ in range(int(random.integers(1, most))):
        at = int(random.integers(0, len(changed) + 1))
        length = int(random.integers(1, 24))
        what = int(random.integers(5))
        if what == 0:
            changed[at : at + 1] = random.bytes(1)
        elif what == 1:
            changed[at : at + length] = b""
        elif what == 2:
            changed[at:at] = random.bytes(length)
        elif what == 3:
            changed[at:at] = changed[:length]
        else:
            changed[at : at + length] = (b"\xff", b"\0", b"$VN", b"\x7f", b"\r")[int(random.integers(5))] * length
    return bytes(changed[:LONGEST_INPUT])


def run_target(name: str, given: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """One target in a process of its own: what it did and, where it broke a promise, the input in hexadecimal."""
    state = folder / f"{name}.json"
    line = [sys.executable, "-m", "benchmarks.fuzz_codecs", name, "--child", str(state)]
    line += ["--seconds", str(given.seconds / len(given.targets)), "--megabytes", str(given.megabytes)]
    line += ["--plain"] if given.plain else []
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    outcome: dict[str, Any] = json.loads(state.read_text()) if state.exists() else {}
    if done.returncode:
        inputs = sorted(folder.glob(f"{name}_*"))
        outcome["broke"] = done.stderr[-3000:]
        outcome["input"] = inputs[0].read_bytes().hex() if inputs else ""
    return outcome


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for every target; 1 where one broke a promise."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(NAMES)}")
    parser.add_argument("--seconds", type=float, default=1200.0)
    parser.add_argument("--megabytes", type=float, default=10.0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--plain", action="store_true")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    given.targets = given.targets or list(NAMES)
    if given.child:
        work = plain if given.plain else guided
        work(given.targets[0], given.seconds, round(given.megabytes * 1e6), given.child)
        return 1
    outcomes = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in given.targets:
            outcome = outcomes[name] = run_target(name, given, Path(folder))
            told = f"{outcome.get('bytes', 0) / 1e6:9.2f} MB {outcome.get('inputs', 0):9d} inputs"
            print(f"{name:14}{told} {outcome.get('seconds', 0):7.1f} s  {'BROKE' if 'broke' in outcome else 'held'}")
            if "broke" in outcome:
                print(outcome["broke"], f"input: {outcome['input']}", sep="\n")
            sys.stdout.flush()
            if given.json:
                given.json.write_text(json.dumps(outcomes, indent=1))
    return 1 if any("broke" in outcome for outcome in outcomes.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
