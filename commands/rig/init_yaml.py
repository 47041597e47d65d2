"""The commented rig.yaml that `rig init` writes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from commands.terminal.display import plain
from drivers import amplifiers, gyroscopes

GUESS, FILL_IN = "GUESS: ", "FILL IN: "


@dataclass(frozen=True)
class Entry:
    """One line under ``columns`` or ``scale``: key, value as YAML, and what stands behind it."""

    key: str
    value: str
    why: str
    is_guess: bool

    def line(self, width: int) -> str:
        """The line with its comment."""
        return f"    {f'{self.key}: {self.value}':<{width}}  # {GUESS if self.is_guess else ''}{plain(self.why)}"


def text_value(text: str) -> str:
    """A text that YAML reads back as it is, on one line."""
    return json.dumps(text, ensure_ascii=not text.isprintable())


def number_value(value: float) -> str:
    """A factor with the digits that it needs."""
    return f"{value:.12g}"


def recorded_yaml(
    files: Sequence[str],
    about: str,
    columns: Sequence[Entry],
    scales: Sequence[Entry],
    axis: str,
    config: str,
    rate: Entry | None = None,
) -> str:
    """The configuration of a campaign that is read: its runs, their columns, and what may be added.

    ``about`` says what is in the first file, ``rate`` how often the rows of files without a time were taken.
    """
    source = f"{plain(files[0])} and {len(files) - 1} more" if len(files) > 1 else plain(files[0])
    return "\n".join(
        [
            f"# Made by `rig init` from {source}. Read the lines marked GUESS, then",
            "#",
            f"#     rig check {plain(config)}",
            f"#     identify-run {plain(config)}",
            "",
            "backend: recorded",
            "",
            "recorded:",
            "  runs:",
            f"    - file: {text_value(files[0])}  # {plain(about)}",
            *(f"    - file: {text_value(file)}" for file in files[1:]),
            "    # - file: another.csv       # further runs of the same columns",
            "    #   use: holdout            # fit | holdout; where no run says, the program chooses",
            "",
            *_section("columns", columns, ()),
            *_section(
                "scale",
                scales,
                ("  # scale: {torque: 35.15}      # factors to s, N m, rad/s, rad; none: units as the file says",),
            ),
            *([] if rate is None else [rate.line(0)[2:]]),
            f"  axis: {axis}                  # rotary: N m, rad | linear: N, m",
            "  # torque_hold: zero_order     # each torque was held until the next; default: band_limited",
            "",
            "# What you expect. The results are compared with it, and the genetic algorithm searches around it.",
            "# model:",
            "#   inertia_kg_m2: 0.02",
            "#   damping_nm_s_rad: 0.045",
            "#   stiffness_nm_rad: 677.3",
            "#   terms: [inertia, damping]   # where your rig has no spring",
            "",
        ]
    )


def _section(name: str, entries: Sequence[Entry], otherwise: Sequence[str]) -> list[str]:
    if not entries:
        return list(otherwise)
    width = max(len(f"{e.key}: {e.value}") for e in entries)
    return [f"  {name}:", *(entry.line(width) for entry in entries)]


def bench_yaml(gyro: str | None, can: Mapping[str, str] | None, seen: Sequence[str], config: str) -> str:
    """The configuration of a bench: guessed ports, and everything that only its owner knows marked as such."""
    interface = can["interface"] if can else "slcan_bulk"
    channel = can["channel"] if can else None
    return "\n".join(
        [
            "# Made by `rig init`. Check the lines marked GUESS and complete those marked FILL IN; then",
            "#",
            f"#     identify-run {plain(config)} --emulate   on emulated devices; nothing moves",
            f"#     rig check {plain(config)}                everything but torque, on the real ones",
            f"#     identify-run {plain(config)}             asks before it applies torque",
            "#",
            "# Found on this machine:",
            *(f"#   {plain(line)}" for line in seen),
            "",
            "backend: bench",
            "",
            "model:                          # FILL IN: the expected platform, on which the forecast is based",
            "  inertia_kg_m2: 0.02",
            "  damping_nm_s_rad: 0.045",
            "  stiffness_nm_rad: 677.3",
            "",
            "limits:                         # FILL IN: what your rig may do; beyond it the torque goes off",
            "  travel_deg: 5",
            "  rate_deg_s: 100",
            "  torque_nm: 10",
            "",
            "excitation:",
            "  scale_to_limits: true         # sets that would break a limit are reduced",
            "  margin: 0.8                   # of the limits",
            "  sets:                         # FILL IN: below, near and above the expected resonance",
            "    - {torque_nm: 10, frequency_hz: 0.5, duration_s: 10}",
            "    - {torque_nm: 10, frequency_hz: 3.0, duration_s: 10}",
            "    - {torque_nm: 10, frequency_hz: 9.0, duration_s: 10}",
            "",
            "bench:",
            "  gyroscope:",
            f"    device: stim300             # FILL IN: {' | '.join(gyroscopes.DRIVERS)} (docs/devices)",
            _port("    port", gyro, "the gyroscope's serial port; null runs with --emulate only"),
            "    axis: z                     # FILL IN: the sensitive axis along the shaft",
            "  amplifier:",
            f"    device: cia402              # FILL IN: {' | '.join(amplifiers.DRIVERS)}",
            "    node: 1                     # FILL IN: the drive's address on the bus",
            "    gear_ratio: 1.0             # FILL IN: shaft torque over motor torque",
            "    can:",
            f"      interface: {text_value(interface)}  # {GUESS if can else FILL_IN}in python-can; slcan_bulk: serial",
            _port("      channel", channel, "the CAN adapter; null runs with --emulate only"),
            "      bitrate: 1000000          # FILL IN: as the drive is set",
            "",
        ]
    )


def _port(key: str, value: str | None, what: str) -> str:
    shown = "null" if value is None else text_value(value)
    return f"{key}: {shown}  # {FILL_IN if value is None else GUESS}{what}"
