"""A case as a user would have it: files of samples and a rig.yaml. The truth goes somewhere else."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from benchmarks.field.cases import Case


def write_case(case: Case, folder: Path, truth: Path) -> None:
    """Samples and rig.yaml into ``folder``, the truth into the file ``truth``, which stands elsewhere."""
    folder.mkdir(parents=True, exist_ok=True)
    suffix = list(WRITERS)[case.number % len(WRITERS)]
    files = []
    for i, run in enumerate(case.measured):
        path = folder / f"run{1 + i:02d}{suffix}"
        WRITERS[suffix](path, run.columns)
        files.append(path.name)
    (folder / "rig.yaml").write_text(rig_yaml(case, files), encoding="utf-8")
    truth.parent.mkdir(parents=True, exist_ok=True)
    truth.write_text(json.dumps(case.truth(), indent=1) + "\n", encoding="utf-8")


def _csv(path: Path, table: Mapping[str, Any]) -> None:
    np.savetxt(path, np.stack(list(table.values()), axis=1), "%.10g", ",", header=",".join(table), comments="")


def _h5(path: Path, table: Mapping[str, Any]) -> None:
    with h5py.File(path, "w") as file:
        for name, values in table.items():
            file[name] = values


def _npz(path: Path, table: Mapping[str, Any]) -> None:
    np.savez(path, **table)


WRITERS: Mapping[str, Callable[[Path, Mapping[str, Any]], None]] = {".csv": _csv, ".npz": _npz, ".h5": _h5}


def rig_yaml(case: Case, files: list[str]) -> str:
    """J, C, K as somebody would guess them, whether the torque is a command that was held, and nothing else."""
    j, c, k = case.declared
    terms = f"  terms: [{', '.join(case.terms)}]\n" if case.terms else ""
    hold = "  torque_hold: zero_order\n" if case.rig.torque_column == "command" else ""
    return (
        f"name: case {case.number:04d}\nbackend: recorded\nmodel:\n  inertia_kg_m2: {j:.4g}\n"
        f"  damping_nm_s_rad: {c:.4g}\n  stiffness_nm_rad: {k:.4g}\n{terms}recorded:\n{hold}  runs:\n"
        + "".join(f"    - file: {file}\n" for file in files)
    )
