"""What happens when something fails: each fault at random moments, as the emulated drive saw it.

    python -m benchmarks.faults [--times 3] [--jobs 2] [--out TABLE.md] [FAULT ...]

`rig play` plays on devices that `rig emulate` emulates, each a process of its own; some way into the set something is
done to either. From the drive's own events comes when the torque was zero, from the host's files when it knew and what
was recorded. A try passes where

- the host's verdict came within the time stated for this fault, and the torque was zero within 20 ms of it; or, where
  the command path or the host is dead, within the heartbeat time of 100 ms and 20 ms of the fault;
- the exit code is the one that SPEC states, nothing was left running, no traceback was shown;
- no more than the last 100 ms were lost of what was recorded.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import json
import math
import random
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.emulated import OFF, SET_S, SHORT, TO_THE_SET_S, Devices, Host, Recovered, recovered
from benchmarks.fault_cases import CASES, LATER, Case, Road

REACTION_S, WATCHDOG_S, LOST_S = 0.020, 0.120, 0.100
HANGS_S = 30.0
ATTEMPTS, PAUSED_S = 4, 0.01


class Outcome(NamedTuple):
    """Of one try; times in seconds, NaN where there is none. ``wrong`` says what did not pass."""

    code: int | None
    zero_s: float
    verdict_s: float
    reaction_s: float
    lost_s: float
    said: str
    wrong: tuple[str, ...]
    disturbed: bool = False


def undisturbed(case: Case, after_s: float, folder: Path) -> Outcome:
    """One try; again where this machine stalled by itself, which is another fault than the one looked at."""
    for attempt in range(ATTEMPTS):
        outcome = one_try(case, after_s, folder.with_name(f"{folder.name}-{attempt}"))
        if not outcome.disturbed:
            break
    return outcome


def one_try(case: Case, after_s: float, folder: Path) -> Outcome:
    """Play, let it fail so long into the set, and look at what came of it."""
    with Devices((*SHORT, *case.devices)) as devices:
        if case.before:
            fault_s = case.strike(devices, None)
            host = Host(devices, folder, (*SHORT, *case.overrides))
        else:
            host = Host(devices, folder, (*SHORT, *case.overrides), terminal=case.terminal())
            if devices.wait_for(("enabled",), 30.0) is None:
                host.ended(1.0)
                return never_on(f"the drive was never enabled: {host.said}")
            devices.wait_for(("nothing",), TO_THE_SET_S + after_s)
            fault_s = case.strike(devices, host)
        code = host.ended(HANGS_S)
        devices.wait_for(("nothing",), 0.4)  # until the drive's own watchdog has had its time
        return judged(case, devices, host, code, fault_s, recovered(folder))


def never_on(why: str) -> Outcome:
    return Outcome(None, math.nan, math.nan, math.nan, math.nan, why, (why,), disturbed=True)


def judged(case: Case, devices: Devices, host: Host, code: int | None, fault_s: float, found: Recovered) -> Outcome:
    zero = devices.first(OFF, fault_s)
    zero_s = float(zero["time_s"]) - fault_s if zero is not None else math.nan
    verdict_s = found.verdict_s - case.ahead_s - fault_s if found.verdict_s is not None else math.nan
    end_s = fault_s + (0.0 if case.host_dies or math.isnan(verdict_s) else verdict_s)
    lost_s = end_s - found.last_sample_s if found.last_sample_s is not None else math.nan
    wrong = []
    if code is None:
        wrong.append(f"hung for {HANGS_S:g} s")
    elif code not in case.codes:
        wrong.append(f"exit {code}, expected {' or '.join(map(str, sorted(case.codes)))}")
    if "Traceback" in host.said:
        wrong.append("a traceback was shown")
    if left := host.left_over():
        wrong.append(f"left running: {left}")
    if case.before:
        if any(e["event"] == "enabled" for e in devices.events) != (case.path is Road.WORKS):
            wrong.append("enabled" if case.path is not Road.WORKS else "never enabled")
    elif code != 0:
        wrong += _times(case, zero_s, verdict_s)
        if not lost_s <= LOST_S:
            wrong.append(f"{lost_s * 1e3:.0f} ms of the recording lost")
    last = devices.events[-1]
    if last.get("torque_nm", [0, 0])[1] != 0.0:
        wrong.append("torque at the end")
    until_s = fault_s + (zero_s if zero_s < 1.0 else 1.0)
    paused = [e for e in devices.events if e["event"] == "paused" and fault_s - 0.3 < e["time_s"] < until_s + 0.1]
    disturbed = verdict_s < -1e-3 or any(float(e["detail"].split()[-2]) > PAUSED_S * 1e3 for e in paused)
    return Outcome(
        code, zero_s, verdict_s, zero_s - verdict_s, lost_s, host.said, tuple(wrong), disturbed and bool(wrong)
    )


def _times(case: Case, zero_s: float, verdict_s: float) -> list[str]:
    """What came too late, if anything."""
    if math.isnan(zero_s):
        return ["torque never zero"]
    if case.path is not Road.WORKS:
        return [] if zero_s <= WATCHDOG_S else [f"zero after {zero_s * 1e3:.0f} ms, limit {WATCHDOG_S * 1e3:.0f}"]
    wrong = []
    if math.isnan(verdict_s):
        return [] if zero_s <= case.detected_s + REACTION_S else [f"zero after {zero_s * 1e3:.0f} ms"]
    if verdict_s > case.detected_s:
        wrong.append(f"verdict after {verdict_s * 1e3:.0f} ms, stated {case.detected_s * 1e3:.0f}")
    if zero_s - verdict_s > REACTION_S:
        wrong.append(f"zero {1e3 * (zero_s - verdict_s):.0f} ms after the verdict")
    return wrong


def _span(values: Sequence[float]) -> str:
    known = [v * 1e3 for v in values if not math.isnan(v)]
    if not known:
        return "-"
    low, high = min(known), max(known)
    return f"{low:.0f}" if round(low) == round(high) else f"{low:.0f} to {high:.0f}"


def row(case: Case, tries: Sequence[Outcome]) -> str:
    """One line of the table; what played on to its end has no times."""
    codes = ", ".join(str(code) for code in sorted({t.code for t in tries if t.code is not None}))
    wrong = sorted({text for t in tries for text in t.wrong})
    ended = [] if case.before else [t for t in tries if t.code != 0]
    by_host = case.path is Road.WORKS and not case.before
    stated = f"{case.detected_s * 1e3:.0f}" if by_host else "-"
    stated = "may play on" if case.detected_s == LATER else stated
    limit = "-" if case.before else "verdict + 20" if by_host else "120"
    cells = (
        case.name, _span([t.verdict_s for t in ended]), stated, _span([t.reaction_s for t in ended] if by_host else []),
        "never on" if case.before else _span([t.zero_s for t in ended]), limit, codes,
        _span([t.lost_s for t in ended]), "; ".join(wrong) or "pass",
        case.quote(next((t.said for t in tries if t.said), "")).replace("|", "/"),
    )  # fmt: skip
    return "| " + " | ".join(cells) + " |"


HEAD = (
    "| fault | verdict, ms | stated | verdict to zero, ms | fault to zero, ms | limit | exit | lost, ms | result "
    "| says |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)


def main(given: Sequence[str] | None = None) -> int:
    """Print a row for every fault; returns how many failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("faults", nargs="*", default=[])
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--keep", type=Path, help="where every try is kept, so that an interrupted call goes on")
    arguments = parser.parse_args(given)
    cases = [case for case in CASES if not arguments.faults or case.name in arguments.faults]
    tries = _earlier(arguments.keep)
    todo = [(case, k) for k in range(arguments.times) for case in cases if k >= len(tries.get(case.name, []))]
    with (
        tempfile.TemporaryDirectory() as scratch,
        concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool,
    ):
        waiting = {
            pool.submit(undisturbed, case, moment_s(arguments.seed, case.name, k), Path(scratch) / f"{n}"): case
            for n, (case, k) in enumerate(todo)
        }
        for future in concurrent.futures.as_completed(waiting):
            case, outcome = waiting[future], future.result()
            tries.setdefault(case.name, []).append(outcome)
            print(row(case, [outcome]), flush=True)
            if arguments.keep is not None:
                with arguments.keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"fault": case.name, **outcome._asdict()}) + "\n")
    table = [HEAD, *(row(case, tries[case.name]) for case in cases)]
    failed = sum(any(t.wrong for t in tries[case.name]) for case in cases)
    told = f"{len(cases)} faults, {sum(len(tries[c.name]) for c in cases)} tries, {failed} faults failed"
    print("\n".join([*table, told]))
    if arguments.out is not None:
        arguments.out.write_text("\n".join([*table, "", told]) + "\n", encoding="utf-8")
    return failed


def moment_s(seed: int, name: str, k: int) -> float:
    """When in the set: random, and the same whenever the benchmark is run with this seed."""
    return random.Random(f"{seed} {name} {k}").uniform(0.1, 0.6 * SET_S)


def _earlier(path: Path | None) -> dict[str, list[Outcome]]:
    """Tries of an earlier call that was interrupted."""
    found: dict[str, list[Outcome]] = {}
    if path is not None and path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            values = json.loads(line)
            values["wrong"] = tuple(values["wrong"])
            found.setdefault(values.pop("fault"), []).append(Outcome(**values))
    return found


if __name__ == "__main__":
    sys.exit(min(main(), 1))
