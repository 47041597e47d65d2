"""Play an excitation file on a hidden platform: `python -m benchmarks.blind.play TRUTH.json EXCITATION.yaml --out DIR`.

The file is what a planner writes: a rig.yaml with an `excitation:` section, or that section alone. The result is
a folder that `identify-run` reads; with `--add CASE` it holds the runs of that case as well.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[2])

import numpy as np
import yaml

from benchmarks.blind.excitations import Excitation, read
from benchmarks.blind.hidden import Hidden, Record
from benchmarks.blind.recordings import rig_yaml, write_runs

TRAVEL_DEG, RATE_DEG_S = 10.0, 400.0


def play(hidden: Hidden, sets: Sequence[Excitation], first: int = 100) -> tuple[list[Excitation], list[Record]]:
    """Play every set from rest, as a guarded rig would: what breaks travel or rate is played with less torque.

    ``first`` numbers the sets, so that a disturbance has another phase than in the campaign before.
    """
    played, records = [], []
    for i, asked in enumerate(sets):
        excitation = asked
        for _ in range(12):
            (record,) = hidden.play([excitation], first + i)
            travel = math.degrees(np.abs(record.angle_rad - record.angle_rad[0]).max())
            rate = math.degrees(np.abs(record.rate_rad_s).max())
            strain = max(travel / min(TRAVEL_DEG, asked.cap_deg or TRAVEL_DEG), rate / RATE_DEG_S)
            if strain <= 1.0:
                break
            excitation = excitation.scaled(0.97 / strain)
        played.append(excitation)
        records.append(record)
    return played, records


def follow_up(truth: Path, excitation: Path, out: Path, case: Path | None = None) -> list[float]:
    """Write the recordings of an excitation file. Returns by how much each set's torque had to be scaled."""
    content = json.loads(truth.read_text(encoding="utf-8"))
    hidden = Hidden.from_json(content["hidden"])
    sets, rate_hz = read(excitation)
    hidden = Hidden.from_json({**content["hidden"], "step_s": 1.0 / rate_hz})
    played, records = play(hidden, sets)
    rng = np.random.default_rng([content["number"], len(sets), hidden.phase_seed])
    measured = [hidden.measured(r, rng) for r in records]
    out.mkdir(parents=True, exist_ok=True)
    files, uses = [], []
    declared = content["reference"]
    if case is not None:
        before = yaml.safe_load((case / "rig.yaml").read_text(encoding="utf-8"))
        declared = list(before["model"].values())
        for run in before["recorded"]["runs"]:
            shutil.copy(case / run["file"], out)
            files.append(run["file"])
            uses.append(run.get("use", "auto"))
    files += write_runs(hidden, records, measured, out, ".npz", first=101)
    uses += [s.use for s in sets]
    (out / "rig.yaml").write_text(
        rig_yaml(f"follow-up {content['number']:04d}", files, uses, declared), encoding="utf-8"
    )
    return [p.numbers[0] / s.numbers[0] for p, s in zip(played, sets, strict=True)]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("truth", type=Path)
    parser.add_argument("excitation", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--add", type=Path, help="folder of the case whose runs stand beside the new ones")
    a = parser.parse_args()
    factors = follow_up(a.truth, a.excitation, a.out, a.add)
    print(f"{a.out / 'rig.yaml'}: {len(factors)} set(s), torque scaled by {', '.join(f'{f:.3g}' for f in factors)}")


if __name__ == "__main__":
    main()
