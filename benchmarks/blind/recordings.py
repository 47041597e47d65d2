"""A case as a user would have it: files of samples and a rig.yaml. The truth goes somewhere else."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from benchmarks.blind.cases import Case
from benchmarks.blind.hidden import Hidden, Record

SUFFIXES = (".npz", ".csv", ".h5")


def write_case(case: Case, folder: Path, truth: Path) -> None:
    """Samples and rig.yaml into ``folder``, the truth into the file ``truth``, which stands elsewhere."""
    folder.mkdir(parents=True, exist_ok=True)
    files = write_runs(case.hidden, case.records, case.measured, folder, SUFFIXES[case.number % len(SUFFIXES)])
    uses = [s.use for s in case.sets]
    (folder / "rig.yaml").write_text(rig_yaml(f"case {case.number:04d}", files, uses, case.declared), encoding="utf-8")
    truth.parent.mkdir(parents=True, exist_ok=True)
    truth.write_text(json.dumps(case.truth(), indent=1) + "\n", encoding="utf-8")


def write_runs(
    hidden: Hidden, records: Sequence[Record], measured: Sequence[Any], folder: Path, suffix: str, first: int = 1
) -> list[str]:
    """One file a set; returns their names."""
    names = []
    for i, (record, channel) in enumerate(zip(records, measured, strict=True)):
        column = "rate_rad_s" if hidden.channel == "rate" else "angle_rad"
        table = {"time_s": record.time_s, "torque_nm": record.torque_nm * hidden.torque_scale, column: channel}
        path = folder / f"run{first + i}{suffix}"
        WRITERS[suffix](path, table)
        names.append(path.name)
    return names


def _csv(path: Path, table: dict[str, Any]) -> None:
    np.savetxt(path, np.stack(list(table.values()), axis=1), "%.12g", ",", header=",".join(table), comments="")


def _h5(path: Path, table: dict[str, Any]) -> None:
    with h5py.File(path, "w") as file:
        for name, values in table.items():
            file[name] = values


WRITERS = {".npz": lambda path, table: np.savez(path, **table), ".csv": _csv, ".h5": _h5}


def rig_yaml(name: str, files: Sequence[str], uses: Sequence[str], declared: Sequence[float]) -> str:
    """The declared model is J, C and K as somebody would guess them; nothing else is said."""
    j, c, k = declared
    runs = "".join(
        f"    - file: {file}\n" + (f"      use: {use}\n" if use != "auto" else "")
        for file, use in zip(files, uses, strict=True)
    )
    return (
        f"name: {name}\nbackend: recorded\nmodel:\n  inertia_kg_m2: {j:.4g}\n  damping_nm_s_rad: {c:.4g}\n"
        f"  stiffness_nm_rad: {k:.4g}\nrecorded:\n  runs:\n{runs}"
    )
