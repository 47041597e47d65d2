"""The announcement before anything moves: kind of torque, limits, sets, expected time, results folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from commands.terminal.display import counted, plain
from rig.config.root import Config
from rig.excitation import PlannedSet
from rig.interface import Statement, Torque
from rig.preflight import peak_torque_nm
from rig.rounding import rounded_down
from rig.sequencer import SETTLE_S, TAIL_S
from rig.sequencer.probe import Probe

SEPARATOR_LINE = "=" * 78


def announcement(
    statement: Statement, config: Config, sets: Sequence[PlannedSet], folder: Path, then: str = "the identification"
) -> str:
    """The opening statement of a campaign that is played; ``then`` is what follows it."""
    limits = config.limits
    lines = [SEPARATOR_LINE, f"  {plain(str(statement))}", SEPARATOR_LINE]
    lines.append(
        f"limits    travel {limits.travel_deg:g} deg, rate {limits.rate_deg_s:g} deg/s, torque {limits.torque_nm:g} N m"
    )
    lines += [f"{'sets' if i == 0 else '':10}{_line(s)}" for i, s in enumerate(sets)]
    if statement.torque is not Torque.SIMULATED and config.bench is not None:
        lines.append(f"probe     {_probe(config, sets)}")
    lines += [f"time      {_time(statement, config, sets)}; then {then}", f"results   {plain(str(folder))}"]
    return "\n".join(lines)


def recorded_announcement(files: int, runs: int, folder: Path) -> str:
    """The opening statement where nothing is played."""
    summary = f"Torque is RECORDED: nothing moves; {counted(runs, 'run')} read from {counted(files, 'file')}"
    return "\n".join([SEPARATOR_LINE, f"  {summary}", SEPARATOR_LINE, f"results   {plain(str(folder))}"])


def duration_s(config: Config, sets: Sequence[PlannedSet]) -> float:
    """How long the campaign takes on its own clock, in seconds."""
    rests_s = SETTLE_S + config.excitation.rest_s * max(0, len(sets) - 1)
    return rests_s + sum(s.duration_s + TAIL_S for s in sets)


def _line(planned: PlannedSet) -> str:
    peak_nm = peak_torque_nm(planned)
    most = f"{plain(planned.name)}: {planned.duration_s:g} s, up to "
    if planned.scale == 1.0:
        return f"{most}{peak_nm:.1f} N m"
    return f"{most}{rounded_down(peak_nm)} N m, reduced to {100 * planned.scale:.1f} % to stay within the limits"


def _probe(config: Config, sets: Sequence[PlannedSet]) -> str:
    assert config.bench is not None
    if not config.bench.probe.play:
        return "NONE (bench.probe.play is false): the first torque is that of the first set"
    most_nm = Probe(config.bench.probe, config.limits, config.model.platform(), sets).largest_nm
    return f"small pulses first, up to {most_nm:.1f} N m while the platform does not move"


def _time(statement: Statement, config: Config, sets: Sequence[PlannedSet]) -> str:
    seconds = duration_s(config, sets)
    if statement.torque is Torque.SIMULATED:
        return f"{seconds:.0f} s of simulated time, computed in a few seconds"
    settle_s = config.bench.settle_s if config.bench is not None else 0.0
    return f"{seconds + settle_s:.0f} s on the bench"
