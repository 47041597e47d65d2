"""The blind bench: `python -m benchmarks.blind.run --seed N --cases 40 --out DIR`.

Every case is generated, given to `identify-run` as a folder of recordings, and scored. DIR/cases holds what the
tool reads, DIR/truth what it does not, DIR/results what it wrote. A bench that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[2])  # this folder's names must not hide those of libraries

from benchmarks.blind.bound import DETECTABLE
from benchmarks.blind.cases import Order, make, orders
from benchmarks.blind.excitations import Excitation
from benchmarks.blind.hidden import Diverged, Hidden
from benchmarks.blind.imitation import confusable
from benchmarks.blind.play import follow_up
from benchmarks.blind.recordings import write_case
from benchmarks.blind.score import Score, score
from benchmarks.blind.tables import listing, table

TIME_LIMIT_S = 600.0


def identify(case: Path, results: Path) -> tuple[float, float, int]:
    """Run the installed command on a case. Returns wall and processor seconds and the exit code."""
    command = [str(Path(sys.executable).parent / "identify-run"), str(case / "rig.yaml"), "--out", str(results)]
    if shutil.which("nice"):
        command = ["nice", "-n", "15", *command]
    results.parent.mkdir(parents=True, exist_ok=True)
    before, begin = os.times(), time.monotonic()
    try:
        done = subprocess.run([*command, "--quiet"], capture_output=True, text=True, timeout=TIME_LIMIT_S, check=False)
        code, said = done.returncode, done.stdout + done.stderr
    except subprocess.TimeoutExpired as late:
        code, said = -1, f"no end after {late.timeout:g} s"
    wall = time.monotonic() - begin
    after = os.times()
    results.with_suffix(".log").write_text(said, encoding="utf-8")
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return wall, cpu, code


def one(seed: int, number: int, order: Order, out: Path, again: bool, rivals: bool) -> Score | None:
    """Generate, run and score one case; what stands there already is not made again."""
    name = f"case_{number:04d}"
    case, truth, results = out / "cases" / name, out / "truth" / f"{name}.json", out / "results" / name
    if not truth.exists():
        try:
            write_case(make(seed, number, order), case, truth)
        except Diverged as error:
            print(error, file=sys.stderr)
            return None
    clock = results.with_suffix(".seconds.json")
    if again or not clock.exists():
        shutil.rmtree(results, ignore_errors=True)  # what a stopped bench has left
        clock.write_text(json.dumps(identify(case, results)), encoding="utf-8")
    return _scored(truth, results, rivals)


def _scored(truth: Path, results: Path, rivals: bool) -> Score:
    wall, cpu, code = json.loads(results.with_suffix(".seconds.json").read_text(encoding="utf-8"))
    path = results / "result.json"
    result = json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
    content = json.loads(truth.read_text(encoding="utf-8"))
    alike = _alike(truth, content) if rivals and content["kind"] == "single" else None
    return score(content, result, wall, cpu, code, alike)


def _alike(truth: Path, content: dict[str, Any]) -> dict[str, list[str]]:
    """Effects that pass for the true one in this record; kept beside the truth, since it takes a minute."""
    path = truth.with_suffix(".rivals.json")
    if not path.exists():
        hidden, sets = Hidden.from_json(content["hidden"]), [Excitation.from_json(s) for s in content["sets"]]
        path.write_text(json.dumps({e: confusable(hidden, sets, e) for e in content["effects"]}), encoding="utf-8")
    found = json.loads(path.read_text(encoding="utf-8"))
    return {e: [r for r, energy in of.items() if energy < DETECTABLE] for e, of in found.items()}


def follow(number: int, out: Path, file: str, again: bool) -> Score | None:
    """Play what the tool asked for next, give it all the data, score once more. None where it asked for nothing."""
    name = f"case_{number:04d}"
    wish, truth = out / "results" / name / file, out / "truth" / f"{name}.json"
    if not wish.exists():
        return None
    case, results = out / "followed" / name, out / "followed_results" / name
    if again or not results.with_suffix(".seconds.json").exists():
        shutil.rmtree(case, ignore_errors=True)
        shutil.rmtree(results, ignore_errors=True)
        follow_up(truth, wish, case, out / "cases" / name)
        results.with_suffix(".seconds.json").write_text(json.dumps(identify(case, results)), encoding="utf-8")
    return _scored(truth, results, False)


def write(scores: Sequence[Score], followed: Sequence[tuple[Score, Score]], seed: int, out: Path) -> str:
    """The tables, also as files."""
    text = table(scores, f"seed {seed}, {len(scores)} cases", followed)
    after = "\nAfter the follow-up\n\n" + listing([s for _, s in followed]) if followed else ""
    (out / "table.md").write_text(text + "\n" + listing(scores) + after, encoding="utf-8")
    (out / "scores.json").write_text(json.dumps([asdict(s) for s in scores], indent=1) + "\n", encoding="utf-8")
    return text


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kinds", nargs="*", default=[], help="single, pair, outside, clean, torque_scale")
    parser.add_argument("--effects", nargs="*", default=[], help="only these effects")
    parser.add_argument("--campaign", default="", help="the same for all; low_sines leaves much to follow-ups")
    parser.add_argument("--only", nargs="*", type=int, default=[], help="only the cases of these numbers")
    parser.add_argument("--again", action="store_true", help="run the tool once more on cases that stand there")
    parser.add_argument("--rivals", action="store_true", help="find out who passes for whom (a minute a case)")
    parser.add_argument(
        "--follow-up", default="follow_up.yaml", help="excitation file that the tool leaves in its results"
    )
    parser.add_argument("--generate", action="store_true", help="write the cases and stop")
    a = parser.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    scores: list[Score] = []
    followed: list[tuple[Score, Score]] = []
    for number, order in enumerate(orders(a.seed, a.cases, a.kinds, a.effects, a.campaign)):
        if a.only and number not in a.only:
            continue
        if a.generate:
            write_case(make(a.seed, number, order), a.out / "cases" / f"case_{number:04d}",
                       a.out / "truth" / f"case_{number:04d}.json")  # fmt: skip
            continue
        found = one(a.seed, number, order, a.out, a.again, a.rivals)
        if found is not None:
            scores.append(found)
            after = follow(number, a.out, a.follow_up, a.again)
            followed += [(found, after)] if after else []
            said = f"{found.wrong or 'right'}: {'+'.join(found.truth) or found.kind} -> {'+'.join(found.named) or '-'}"
            print(f"{number:4d} {found.seconds:5.1f} s  {said}", file=sys.stderr, flush=True)
            write(scores, followed, a.seed, a.out)
    if scores:
        print(write(scores, followed, a.seed, a.out))


if __name__ == "__main__":
    main()
