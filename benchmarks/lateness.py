"""Lateness of the bench's 1 kHz loop against a bare deadline loop, in alternating pairs.

    python -m benchmarks.lateness [--pairs 10] [--seconds 60] [CONFIG]

The bench side is the product: sequencer, guard, gyro and drive through their drivers, raw capture to disk,
devices emulated in another process. The bare side waits for the same deadlines and does nothing. Both ask for
the same real-time priority, with the emulators running in both, so the ratio of a pair says what the bench's
own work costs; what else the machine is doing shows in the spread between pairs.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from drivers.bench import BenchRig
from rig import realtime
from rig.clock import MonotonicClock
from rig.config.load import load_config
from rig.config.root import Config
from rig.guard import Guard
from rig.guard.motion import motion_checks
from rig.interface import Torque
from rig.preflight import plan
from rig.sequencer import Sequencer
from rig.sequencer.lateness import Lateness
from rig.sequencer.warm_up import warm_up
from sim_backend.emulators.launch import Emulators, on_emulated_ports, started

P99_9 = 0.999
QUANTILES = (0.5, 0.99, P99_9, 1.0)
PERIOD_S = 1e-3


def bare_loop(config: Config, seconds: float) -> tuple[Lateness, float]:
    """Lateness of the ticks, and CPU as a share of one core."""
    assert config.bench is not None
    real_time = config.bench.real_time
    realtime.acquire(real_time.priority, real_time.lock_memory)
    clock = MonotonicClock(real_time.spin_us * 1e-6)
    late, ticks = Lateness(), int(seconds / PERIOD_S)
    start_s, cpu_s = clock.now_s() + 0.01, time.process_time()
    tick = 0
    while tick < ticks:
        deadline_s = start_s + tick * PERIOD_S
        late_s = clock.wait_until(deadline_s) - deadline_s
        late.add(late_s)
        tick += 1 + int(late_s / PERIOD_S)
    cpu = (time.process_time() - cpu_s) / seconds
    realtime.release()
    return late, cpu


class SetCpu:
    """CPU time of the set alone: contact and settling are not part of the loop."""

    def __init__(self, rig: BenchRig) -> None:
        self.cpu_s = self.wall_s = 0.0
        begin, end = rig.begin_set, rig.end_set

        def begins(*given: object) -> None:
            begin(*given)  # type: ignore[arg-type]
            self.cpu_s, self.wall_s = -time.process_time(), -time.monotonic()

        def ends() -> None:
            self.cpu_s += time.process_time()
            self.wall_s += time.monotonic()
            end()

        rig.begin_set, rig.end_set = begins, ends  # type: ignore[method-assign]


def bench_loop(config: Config, emulators: Emulators, raw: Path) -> tuple[Lateness, float, str]:
    """Lateness of the ticks, CPU as a share of one core, and what was lost."""
    section = on_emulated_ports(config, emulators).bench
    assert section is not None
    rig = BenchRig(section, Torque.EMULATED, raw)
    cpu = SetCpu(rig)
    sets = plan(config.model.platform(), config.excitation, config.limits, rig.rate_full_scale_rad_s)
    platform = config.model.platform()
    warm_up(Guard(config.limits, motion_checks(config.limits, platform)), platform, sets, 1.0 / PERIOD_S)
    guard = Guard(config.limits, motion_checks(config.limits, platform))
    played = Sequencer(rig, rig.clock, guard, sample_rate_hz=1.0 / PERIOD_S, rest_s=0.0).play(sets)
    gyro, one = rig.report().gyro, played.statistics[0]
    account = f"{one.missed_ticks} missed, {gyro.lost} of {gyro.received} datagrams lost"
    if played.cause is not None:
        account += f", ended early: {played.cause}"
    return one.late, cpu.cpu_s / max(cpu.wall_s, 1e-9), account


def line(name: str, late: Lateness, cpu: float, account: str = "") -> str:
    """One printed row."""
    numbers = "  ".join(f"{late.quantile_s(q) * 1e6:8.1f}" for q in QUANTILES)
    return f"{name:6s} {numbers}   {100 * cpu:5.1f} %   {account}"


def main(given: Sequence[str] | None = None) -> None:
    """Print every pair and the median of the p99.9 ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("config", nargs="?", default="examples/bench.yaml")
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=60.0)
    arguments = parser.parse_args(given)
    played = f"excitation.sets=[{{torque_nm: 40, frequency_hz: 1, duration_s: {arguments.seconds}}}]"
    # What a busy machine does to the devices' processes is not what is measured here.
    beat = "bench.amplifier.settings.drive_heartbeat_ms=1000"
    watchdog = "bench.amplifier.watchdog_ms=1000"
    patient = ("limits.missed_ticks=1000", "limits.stale_gyro_ms=1000", beat, watchdog)
    config = load_config(arguments.config, [played, *patient]).config
    print(f"{'':6s} {'p50':>8s}  {'p99':>8s}  {'p99.9':>8s}  {'max us':>8s}   {'CPU':>5s}")
    ratios: list[float] = []
    for number in range(arguments.pairs):
        with started(config) as emulators, tempfile.TemporaryDirectory() as folder:
            late, cpu = bare_loop(config, arguments.seconds)
            print(line("bare", late, cpu), flush=True)
            bare = late.quantile_s(P99_9)
            late, cpu, account = bench_loop(config, emulators, Path(folder) / "raw")
            print(line("bench", late, cpu, account), flush=True)
            ratios.append(late.quantile_s(P99_9) / bare)
            print(f"pair {number + 1}: p99.9 ratio {ratios[-1]:.2f}", flush=True)
    print(
        f"median of the p99.9 ratios over {len(ratios)} pairs: {statistics.median(ratios):.2f} "
        f"(from {min(ratios):.2f} to {max(ratios):.2f})"
    )


if __name__ == "__main__":
    main()
