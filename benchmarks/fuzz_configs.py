"""Mutated configurations: each has to load or to be refused as one, in bounded time.

    python -m benchmarks.fuzz_configs [--count 100000] [--seed 1]

The shipped examples are changed as trees (values, keys, branches, nesting) and as text, and given hostile --set texts.
What loads is taken further: to the drivers' own settings and to what a recorded section names.
"""

from __future__ import annotations

import argparse
import copy
import json
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drivers.amplifiers import make_amplifier
from drivers.gyroscopes import make_gyroscope
from rig.config.load import LoadedConfig, load_config
from rig.errors import ConfigError, RecordingError
from rig.recording.load import read_recording

ROOT = Path(__file__).resolve().parents[1]
LONGEST_S = 5.0  # of this process' own time
SEEDS = (
    "rig.yaml",
    "examples/bench.yaml",
    "examples/bench_odrive.yaml",
    "examples/recorded.yaml",
    "examples/table1.yaml",
)
FULL = """
backend: simulated
name: full
model: {inertia_kg_m2: 0.02, damping_nm_s_rad: 0.04, stiffness_nm_rad: 600, terms: [inertia, stiffness],
        effects: {coulomb_friction: {level_nm: 1.0}}}
limits: {travel_deg: 10, rate_deg_s: 400, torque_nm: 300, stale_gyro_ms: 20, stall_ms: 50}
excitation:
  sets: [{torque_nm: 10, frequency_hz: 1}, {kind: chirp, torque_nm: 5, from_hz: 1, to_hz: 20, duration_s: 5}]
simulated:
  platform: {inertia_kg_m2: 0.02, effects: {coulomb_friction: {level_nm: 1.0}}}
  gyro: {sample_rate_hz: 500, noise_deg_s: 0.1}
  amplifier: {kind: motor, control: voltage}
recorded:
  runs: [{file: run.csv, use: fit, from_s: 0, to_s: 1}, {file: run.csv, use: holdout, from_s: 2}]
  columns: {time: T, torque: U}
  scale: {torque: 35.0, rate: 0.1}
identify: {candidates: [coulomb_friction], genetic: {population: 10}, holdout: 0.2, reference: {inertia_kg_m2: 1}}
"""
HOSTILE: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 1e-9, 1e9, -1e300, 1e300, 1e-320, 2**31, 2**63, 2**64, 10**400, -(10**30),
    float("nan"), float("inf"), float("-inf"), "", " ", "0", "nan", "=1+1", "<script>alert(1)</script>",
    "\u202ex", "\0",
    "a" * 5000, "\ud7ff", "\U0001f600", "../../etc/passwd", "/etc/passwd", "/dev/zero", "/dev/random", "/dev/stdin",
    "~/x", "~nobody/x", "~\0", "C:\\con", "http://example.org/a.csv", "file:///etc/passwd", ".", "..", "/",
    "fifo", "loop",
    "link.csv", "rig.yaml", "run.csv", "run.mat", "x.npz", [], {}, [[]], [1, 2], {"a": 1}, {"kind": "sine"},
    [None] * 300,
    "!!python/object/apply:os.system [id]", "*a", "&a", "${HOME}", "$(id)", "%s%n", "{}", "1e3", "0x10",
    "1_000", "on",
)  # fmt: skip
TEXTS = (
    "!!python/object/apply:os.system ['echo hacked']", "!!python/name:os.system", "!!binary aGk=",
    "!!set {a, b}", "!x y",
    "&a [*a]", "*nothing", "<<: {a: 1}", "? [a]\n: b", "--- \n---\n", "%YAML 9.9\n---\n", "\t", "\r", "\ufeff",
    "\x00", "\x85",
    "{" * 300, "[" * 3000, "- " * 2000,
    "a: &a [x,x,x,x,x,x,x,x,x]\nb: &b [*a,*a,*a,*a,*a,*a,*a]\nc: [*b,*b,*b,*b,*b,*b]\n",
    "'", '"', "|", ">", "#", ": ", "9" * 5000, "1e999", ".nan", "-.inf", "0o17", "2001-01-01", "1:30", "\\x41",
    "\u2028",
)  # fmt: skip
Tree = Any
DUMPER = getattr(yaml, "CDumper", yaml.Dumper)  # ten times as fast where it is there


def hostile_folder(folder: Path) -> None:
    """What the paths in the mutated files may meet: a pipe, links in a circle, a link out, a small recording."""
    os.mkfifo(folder / "fifo")
    (folder / "loop").symlink_to(folder / "loop")
    (folder / "link.csv").symlink_to("/etc/passwd")
    rows = "".join(f"{k / 1000},{k % 7},{k % 5}\n" for k in range(3000))
    (folder / "run.csv").write_text(f"T,U,rate_rad_s\n{rows}")
    (folder / "run.mat").write_bytes(b"MATLAB 5.0" + bytes(200))
    (folder / "x.npz").write_bytes(b"PK\x03\x04" + bytes(30))


class Mutator:
    """Makes one hostile text after the other from the seeds."""

    def __init__(self, random: np.random.Generator) -> None:
        self.random = random
        texts = [(ROOT / name).read_text(encoding="utf-8") for name in SEEDS]
        self.trees = [yaml.safe_load(text) for text in (*texts, FULL)]
        self.texts = [yaml.safe_dump(tree, sort_keys=False) for tree in self.trees]

    def _one_of(self, items: Sequence[Any]) -> Any:
        return items[int(self.random.integers(len(items)))]

    def text(self) -> str:
        """A mutated configuration."""
        if self.random.random() < 0.7:
            tree = copy.deepcopy(self._one_of(self.trees))
            for _ in range(int(self.random.integers(1, 4))):
                self._change(tree)
            text = yaml.dump(tree, Dumper=DUMPER, sort_keys=False, allow_unicode=True)
        else:
            text = self._one_of(self.texts)
        if self.random.random() < 0.45:
            text = self._changed_text(text)
        return text

    def _change(self, tree: Tree) -> None:
        """Somewhere in the tree: a value replaced, a key gone, renamed or new,
        a branch of another tree grafted in."""
        containers = list(_containers(tree))
        where = self._one_of(containers)
        keys = list(where) if isinstance(where, dict) else list(range(len(where)))
        what = int(self.random.integers(6))
        if what == 0 and keys:
            del where[self._one_of(keys)]
        elif what == 1 and keys and isinstance(where, dict):
            key = self._one_of(keys)
            where[self._one_of((f"{key}x", str(key)[1:], "", "a.b", 7, None, "effects", key))] = where.pop(key)
        elif what == 2 and isinstance(where, dict):
            where[self._one_of(("kind", "effects", "settings", "faults", "x", "model"))] = copy.deepcopy(
                self._one_of(HOSTILE)
            )
        elif what == 3 and keys:
            graft = self._one_of(list(_containers(self._one_of(self.trees))))
            where[self._one_of(keys)] = copy.deepcopy(graft)
        elif keys:
            where[self._one_of(keys)] = copy.deepcopy(self._one_of(HOSTILE))

    def _changed_text(self, text: str) -> str:
        characters = list(text)
        for _ in range(int(self.random.integers(1, 5))):
            at = int(self.random.integers(0, len(characters) + 1))
            what = int(self.random.integers(4))
            if what == 0:
                characters[at:at] = self._one_of(TEXTS)
            elif what == 1:
                del characters[at : at + int(self.random.integers(1, 20))]
            elif what == 2:
                characters[at : at + 1] = chr(int(self.random.integers(0, 0xD7FF)))
            else:
                start = int(self.random.integers(0, len(characters) + 1))
                characters[at:at] = characters[start : start + int(self.random.integers(1, 200))]
        return "".join(characters)

    def overrides(self) -> list[str]:
        """Hostile --set texts, most often none."""
        if self.random.random() < 0.8:
            return []
        keys = ("identify.seed", "model", "excitation.sets.0.torque_nm", "bench.gyroscope.settings.x", "a.b.c",
        "", "model.",
                "excitation.sets.99.x", "simulated.gyro", "recorded.runs", "name", "backend.x", ".", "=",
                "\0")  # fmt: skip
        return [f"{self._one_of(keys)}={self._one_of((*TEXTS, *map(str, HOSTILE)))}"]


def _containers(tree: Tree) -> Iterator[Any]:
    if isinstance(tree, (dict, list)):
        yield tree
        for inner in tree.values() if isinstance(tree, dict) else tree:
            yield from _containers(inner)


def taken_further(loaded: LoadedConfig) -> None:
    """What a command does next with a sound file: drivers read their settings, recordings are opened."""
    if loaded.config.bench is not None:
        for make, section in (
            (make_gyroscope, loaded.config.bench.gyroscope), (make_amplifier, loaded.config.bench.amplifier)
        ):  # fmt: skip
            try:
                make(section)  # type: ignore[operator]
            except ConfigError as refusal:
                assert str(refusal)
    if loaded.config.recorded is not None:
        read_recording(loaded)
    json.dumps(loaded.config.model_dump(mode="json"))


def one(path: Path, text: str, overrides: Sequence[str]) -> str:
    """Load one; what came of it. Raises whatever is no refusal, and AssertionError for one that says nothing."""
    path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
    begun_s = time.process_time()
    try:
        taken_further(load_config(path, overrides))
        outcome = "loaded"
    except ConfigError as refusal:
        assert str(refusal).strip(), "a refusal without words"
        outcome = "refused"
    except RecordingError as refusal:
        assert str(refusal).strip()
        outcome = "refused its recordings"
    took_s = time.process_time() - begun_s
    assert took_s < LONGEST_S, f"took {took_s:.1f} s"
    return outcome


def run(count: int, seed: int, said: Callable[[str], None] = print) -> Counter[str]:
    """So many mutated configurations; outcomes by kind. What breaks a promise is said with its text."""
    outcomes: Counter[str] = Counter()
    mutator = Mutator(np.random.default_rng(seed))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        hostile_folder(folder)
        for _ in range(count):
            text, overrides = mutator.text(), mutator.overrides()
            try:
                outcomes[one(folder / "rig.yaml", text, overrides)] += 1
            except Exception as error:  # noqa: BLE001  this is what is looked for
                outcomes[f"BROKE: {type(error).__name__}"] += 1
                said(f"BROKE {type(error).__name__}: {str(error)[:300]}\n{overrides!r}\n{text!r}")
    return outcomes


def main(arguments: Sequence[str] | None = None) -> int:
    """Print how many loaded, were refused, or broke a promise; 1 where one did."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    begun_s = time.monotonic()
    outcomes = run(given.count, given.seed)
    for outcome, times in outcomes.most_common():
        print(f"{outcome:24}{times:8d}")
    print(f"{time.monotonic() - begun_s:.0f} s")
    return int(any(outcome.startswith("BROKE") for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
