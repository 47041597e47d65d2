"""What a benchmark leaves behind: a table on the terminal, and beside it JSON with versions, machine and seeds."""

from __future__ import annotations

import argparse
import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

KEPT = Path(__file__).parent / "kept"  # the results that compare holds new ones against
PACKAGES = (
    "isp-rig", "numpy", "scipy", "numba", "pymoo", "deap", "pygad", "cma", "lmfit", "statsmodels", "jax-sysid",
)  # fmt: skip


def versions() -> dict[str, str]:
    """Of Python and of every package that is installed."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


@dataclass(frozen=True)
class Result:
    """One table.

    Attributes
    ----------
    ratios
        Each measured within one run, larger is better: what another machine may be compared by.
    rows
        The table itself.
    """

    name: str
    settings: Mapping[str, Any]
    seeds: Sequence[int]
    ratios: Mapping[str, float]
    rows: Sequence[Mapping[str, Any]]
    date: str = field(default_factory=lambda: f"{datetime.now(UTC):%Y-%m-%d}")
    versions: Mapping[str, str] = field(default_factory=versions)
    machine: str = field(default_factory=lambda: f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()}")


def file_of(folder: Path, name: str, small: bool) -> Path:
    """Where a result stands."""
    return folder / f"{name}{'-small' if small else ''}.json"


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """The options that every benchmark has."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", action="store_true", help="sizes that take a minute or so, for comparisons")
    parser.add_argument("--out", type=Path, help="folder for the JSON; left out: none is written")
    return parser


def print_and_write(result: Result, out: Path | None, small: bool) -> None:
    """Print the table and the ratios, and write the JSON where asked for."""
    names = list(result.rows[0]) if result.rows else []
    print(f"| {' | '.join(names)} |\n|{'---|' * len(names)}")
    for row in result.rows:
        print(f"| {' | '.join(_text(row.get(name)) for name in names)} |")
    for name, ratio in result.ratios.items():
        print(f"{name}: {ratio:.3g}")
    print(f"{result.date}, {result.machine}, {', '.join(f'{k} {v}' for k, v in result.versions.items())}")
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        file_of(out, result.name, small).write_text(json.dumps(asdict(result), indent=1) + "\n", encoding="utf-8")


def _text(value: Any) -> str:
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)
