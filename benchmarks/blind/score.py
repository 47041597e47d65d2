"""What the tool said of a case, against the truth. Nothing here is shared with the tool."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.blind.bound import DETECTABLE, left, nuisances, series
from benchmarks.blind.excitations import Excitation
from benchmarks.blind.hidden import ORDER, Diverged, Hidden
from benchmarks.blind.library import INSEPARABLE

NAMES = ("inertia", "damping", "stiffness")
LIMITS_PERCENT = (0.1, 1.0, 0.1)
NEVER_NAMED = {"rate_bias"}  # a nuisance


@dataclass(frozen=True)
class Score:
    """One case. ``None`` where a question does not apply."""

    number: int
    kind: str
    truth: tuple[str, ...]
    size: float
    noise_deg_s: float
    campaign: str
    detectable: bool
    named: tuple[str, ...]
    rivals: tuple[str, ...]
    unexplained: bool | None
    accepted: bool | None
    first: bool | None  # the right name first
    exact: bool | None  # all of the truth and nothing besides
    declared: bool | None  # the pair that physics cannot part is declared
    errors_percent: tuple[float | None, ...]
    covered: tuple[bool | None, ...]
    residual: float | None  # the tool's own held-out free run over the true noise
    replayed: float | None  # the tool's model, run by the bench, against the noise-free truth: sqrt(1 + rest^2)
    imitates: float | None  # energy by which the tool's model differs from the truth, J, C, K and starts free
    seconds: float
    cpu_seconds: float
    exit_code: int

    @property
    def nothing_to_name(self) -> bool:
        """Clean, a wrong scale of the torque, or a nuisance alone."""
        return self.kind in {"clean", "torque_scale"} or set(self.truth) <= NEVER_NAMED

    @property
    def wrong(self) -> str:
        """What went wrong, in a word; empty where nothing did."""
        if self.exit_code not in (0, 1):
            return f"exit code {self.exit_code}"
        if self.nothing_to_name:
            return "false alarm" if self.named else ("left unexplained" if self.unexplained else "")
        return self._wrong_verdict() if self.detectable else ""

    def _wrong_verdict(self) -> str:
        if self.kind == "outside":
            silent = "" if self.unexplained else "outside: not unexplained"
            return "outside: named" if self.named else silent
        if self.exact:
            return ""
        if not self.named:
            return f"{self.kind}: nothing named"
        if self.kind == "pair":
            return "pair: wrong set"
        return "single: more besides" if self.first else "single: wrong name"


def score(
    truth: Mapping[str, Any], result: Mapping[str, Any] | None, seconds: float, cpu: float, code: int,
    alike: Mapping[str, Sequence[str]] | None = None,
) -> Score:  # fmt: skip
    """Score one result.json (None where there is none).

    ``alike`` are, for every true effect, others that pass for it in this very record (see ``imitation``): they have
    to be declared, and naming one of them counts where the true one is declared beside it.
    """
    alike = alike or {}
    hidden = Hidden.from_json(truth["hidden"])
    effects = tuple(truth["effects"])
    detectable = all(e["energy"] >= DETECTABLE for e in truth["energy"].values())
    noise = math.degrees(hidden.noise) if hidden.channel == "rate" else math.nan
    empty = Score(
        truth["number"], truth["kind"], effects, truth["asked_size"], noise, truth["campaign"], detectable, (), (),
        None, None, None, None, None, (None,) * 3, (None,) * 3, None, None, None, seconds, cpu, code,
    )  # fmt: skip
    if result is None:
        return replace(empty, first=False, exact=False)
    verdict = result["verdict"]
    named = tuple(verdict["effects"])
    rivals = _rivals(verdict, named)
    final = result["after"] or result["before"]
    replayed, imitates = _replay(hidden, truth, final)
    same = imitates is not None and imitates < DETECTABLE
    stand_ins = {
        e: set(INSEPARABLE.get(e, ())) | set(alike.get(e, ())) | (set(named) if same else set()) for e in effects
    }
    first = exact = declared = None
    if effects and truth["kind"] in {"single", "pair"} and not set(effects) <= NEVER_NAMED:
        matched = _matched(effects, named, rivals, stand_ins)
        first = bool(named) and (named[0] in effects or (bool(matched) and named[0] in matched.values()))
        exact = len(matched) == len(effects) and set(matched.values()) == set(named)
        pairs = [e for e in matched if e in INSEPARABLE or alike.get(e)]
        if pairs and first:
            declared = all(_declared(e, matched[e], rivals, set(alike.get(e, ()))) for e in pairs)
    reference = list(truth["reference"])
    if "sine" in final["effect_parameters"].get("unbalance", {}):
        reference[2] = hidden.stiffness * hidden.torque_scale  # its gradient stands in a number of its own
    errors, covered = _parameters(reference, final["parameters"])
    holdout = final["error"].get("holdout_rate_rms")
    return replace(
        empty, named=named, rivals=tuple(sorted(rivals)), unexplained=verdict["unexplained"],
        accepted=result["accepted"], first=first, exact=exact, declared=declared, errors_percent=errors,
        covered=covered, residual=None if holdout is None else holdout / hidden.noise, replayed=replayed,
        imitates=imitates,
    )  # fmt: skip


def _rivals(verdict: Mapping[str, Any], named: Sequence[str]) -> set[str]:
    """Every effect that the verdict names beside those that it lists."""
    out = {x for name in named for x in verdict["confusable_with"].get(name, ())}
    for pair in verdict.get("never_separable", {}):
        out |= {x.strip() for x in pair.split("/")}
    return out - set(named)


def _matched(
    effects: Sequence[str], named: Sequence[str], rivals: set[str], stand_ins: Mapping[str, set[str]]
) -> dict[str, str]:
    """True effect -> the name that stands for it: its own, or a stand-in where the true one is declared beside it."""
    out = {e: e for e in effects if e in named}
    for effect in effects:
        for name in named:
            if effect not in out and name not in effects and effect in rivals and name in stand_ins[effect]:
                out[effect] = name
    return out


def _declared(effect: str, name: str, rivals: set[str], alike: set[str]) -> bool:
    """Whether the verdict says with whom ``name`` may be confused: one of those never parted, all alike here."""
    never = ({effect} | INSEPARABLE.get(effect, frozenset())) - {name}
    here = ({effect} | alike) - {name}
    return (effect not in INSEPARABLE or bool(rivals & never)) and (not alike or here <= rivals)


def _parameters(reference: Sequence[float], found: Mapping[str, Any]) -> tuple[Any, Any]:
    errors: list[float | None] = []
    covered: list[bool | None] = []
    for name, true in zip(NAMES, reference, strict=True):
        if name not in found:
            errors.append(None)
            covered.append(None)
            continue
        low, high = found[name]["ci95"]
        errors.append(100.0 * (found[name]["value"] - true) / true)
        covered.append(low <= true <= high)
    return tuple(errors), tuple(covered)


def _replay(hidden: Hidden, truth: Mapping[str, Any], final: Mapping[str, Any]) -> tuple[float | None, float | None]:
    """Run the tool's model through the bench's own integrator and hold it against the noise-free truth."""
    found = {n: final["parameters"].get(n) for n in NAMES}
    if any(v is None for v in found.values()):
        return None, None
    effects = {n: {k: p["value"] for k, p in v.items()} for n, v in final["effect_parameters"].items()}
    if any(set(v) != set(ORDER.get(n, ())) for n, v in effects.items()):
        return None, None  # one value a set (a disturbance), or a parameter that is not determined
    if any(v.get(k, 1.0) <= 0.0 for v in effects.values() for k in ("time", "displacement", "speed")):
        return None, None
    model = replace(
        hidden, effects=effects, torque_scale=1.0, bias=0.0,
        **{n: v["value"] for n, v in found.items()},  # type: ignore[index]
    )  # fmt: skip
    sets = [Excitation.from_json(s) for s in truth["sets"]]
    scaled = [s.scaled(hidden.torque_scale) for s in sets]
    try:
        true = series(hidden, hidden.play(sets))
        modelled = series(model, model.play(scaled))
    except (Diverged, ValueError):
        return None, None
    rest = [a - b for a, b in zip(true, modelled, strict=True)]
    total = count = 0.0
    for excitation, part in zip(sets, rest, strict=True):
        q, _ = np.linalg.qr(nuisances(model, excitation.times(model.step_s)))
        total += float(np.sum((part - q @ (q.T @ part)) ** 2))
        count += len(part)
    replayed = math.sqrt(1.0 + total / count / hidden.noise**2)
    try:
        (alike,) = left(model, scaled, [rest])
    except Diverged:  # a model at the edge of running away imitates nothing
        return replayed, None
    return replayed, alike / hidden.noise**2
