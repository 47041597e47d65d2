"""What the runs of a proof say of every name: confirmed, partly, refuted, or cannot be told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from identify.proof.compensation import not_cancelled
from identify.proof.deviation import Deviation, deviation, explained_left, share_left
from identify.proof.late import late_of, with_late_ticks
from identify.proof.plan import ALL, PLAIN, REFUTED, ProofPlan, pair_of
from identify.proven import EffectProof, Proof, ProofLines, ProofSet, ProofStatus, Share
from identify.results import NORMAL_95
from identify.wording import plain as plain_words
from rig import effects
from rig.arrays import Array
from rig.platform import Platform
from rig.recording.run import Recording

# Share of the error that may be left of a name that is right, where its own model announces less.
CONFIRMED = 0.10
# Times the share that the model announces: its parameters, on which what is left depends, are estimates.
AS_ANNOUNCED = 1.5
# Reduced chi-square at which what is left is noise.
AT_NOISE = 1.2**2
# Times the error of another name by which it is no better and no worse: less than the models' own numbers move it.
MIN_ERROR_RATIO = 1.1
# Error without compensation over the announced one: from here on the name explains less than a quarter of its power.
UNEXPLAINED_ERROR_RATIO = 2.0
# Share of the error without a name that is left with it, all fitted anew to the runs without compensation, up to
# which not the name is to blame for what compensation left, but its numbers or those of J, C and K.
MAX_REFITTED_SHARE = 0.3


def judge(plan: ProofPlan, recording: Recording, model: Platform) -> Proof:
    """The proof from its runs; sets of which a run is missing are left out.

    Raises
    ------
    ValueError
        Where no set is complete.
    """
    with threadpool_limits(1):  # small matrices: a second BLAS thread only waits
        found = _deviations(plan, recording)
    sets = [name for name in plan.set_names if (name, PLAIN) in found and (name, ALL) in found]
    if not sets:
        raise ValueError("no set of the proof was played both with and without compensation")
    proofs = {variant: _effect(plan, variant, sets, found) for variant in plan.models}
    total = proofs.pop(ALL)
    rivals = {name: one for name, one in proofs.items() if " / " in name}
    single = {name: one for name, one in proofs.items() if name not in rivals}
    if not single and not plan.too_small:
        single = {name: total for name in model.effects if effects.get(name).cancelled_by_torque}
    single |= {name: _too_small(left) for name, left in plan.too_small.items()}
    total, single = _numbers_or_name(plan, recording, total, single)
    total, single, rivals = _compared(plan, sets, found, total, single, rivals)
    late = late_of(plan, recording, model, found)
    single = {name: _told_beforehand(name, with_late_ticks(one, late)) for name, one in single.items()}
    return Proof(
        with_late_ticks(total, late), single, rivals, not_cancelled(model),
        plan.torque_scale, tuple(_lines(name, plan, found) for name in sets), late=late,
    )  # fmt: skip


def _too_small(left: float) -> EffectProof:
    """Of a name without which alone nothing was played."""
    why = (
        f"at least {_percent(left)} of its error would remain beside what remains of the others, so no set was played "
        "to test it alone"
    )
    return EffectProof("cannot be told", why, None, left, ())


Found = Mapping[tuple[str, str], Deviation]


def _deviations(plan: ProofPlan, recording: Recording) -> dict[tuple[str, str], Deviation]:
    """(set, variant) -> how far its run strays from the linear model of the variant; PLAIN from that of the model."""
    runs = {run.name: run for run in recording.runs}
    out: dict[tuple[str, str], Deviation] = {}
    for one in plan.runs:
        run = runs.get(one.planned.name)
        if run is None or run.torque_nm is None or len(run.time_s) < 2:
            continue
        model = plan.models[ALL if one.variant == PLAIN else one.variant]
        out[one.set, one.variant] = deviation(run, one.planned, model, recording.noise)
        if one.variant == PLAIN:  # a rival has J, C and K of its own
            for name, other in plan.models.items():
                if " / " in name:
                    out[one.set, f"{PLAIN} / {name}"] = deviation(run, one.planned, other, recording.noise)
    return out


def _effect(plan: ProofPlan, variant: str, sets: list[str], found: Found) -> EffectProof:
    without, better = pair_of(variant)
    if " / " in variant:
        without = f"{PLAIN} / {variant}"
    rows, pairs = [], []
    for name in sets:
        if (name, without) not in found or (name, better) not in found:
            continue
        a, b = found[name, without], found[name, better]
        duration_s = plan.of(name, PLAIN).duration_s
        pairs.append((a, b, duration_s))
        left = share_left([pairs[-1]])
        rows.append(
            ProofSet(
                name, plan.of(name, pair_of(variant)[0]).name, plan.of(name, better).name, a.rms, b.rms, b.noise, left,
                *plan.announced[variant][name],
            )
        )  # fmt: skip
    if not pairs:
        why = "the proof was stopped before a set of it was complete"
        return EffectProof("cannot be told", why, None, 0.0, ())
    share = share_left(pairs)
    announced = _announced(rows)
    times = _over_announced(rows) if pair_of(variant)[0] == PLAIN else 1.0
    status, why = status_of(share, announced, _reduced_chi_square(rows), times)
    return EffectProof(status, why, share, announced, tuple(rows))


def _announced(rows: list[ProofSet]) -> float:
    """Over all sets, each with the weight of its error."""
    weight = np.array([max(r.error_without**2 - r.noise**2, 0.0) for r in rows])
    left = np.array([r.announced_left**2 for r in rows])
    return float(np.sqrt(np.sum(weight * left) / np.sum(weight))) if np.sum(weight) > 0.0 else 0.0


def _over_announced(rows: list[ProofSet]) -> float:
    before = sum(max(r.error_without**2 - r.noise**2, 0.0) for r in rows)
    expected = sum(r.announced_error**2 for r in rows)
    return float(np.sqrt(before / expected)) if expected > 0.0 else np.inf


def _reduced_chi_square(rows: Sequence[ProofSet]) -> float:
    after = sum(r.error_compensated**2 for r in rows)
    noise = sum(r.noise**2 for r in rows)
    return float(after / noise) if noise > 0.0 else np.inf


def status_of(
    share: Share | None, announced: float, chi_square: float, over_announced: float = 1.0
) -> tuple[ProofStatus, str]:
    """The verdict on a share that is left, and why in a sentence.

    Parameters
    ----------
    announced
        The share that the model itself said would be left.
    chi_square
        The reduced one of what is left.
    over_announced
        The error without compensation over that which the model announces: a name that makes less than half of it
        explains nothing, whatever is left.
    """
    if share is None:
        return "cannot be told", "without compensation, the error does not exceed the sensor's noise"
    went = f"{_percent(share.gone)} of the error was cancelled ({_interval(share)})"
    if share.gone < 0.0:
        went = f"the error grew to {share.left:.3g} times what it was"
    sentence = f"{went}; {_percent(1.0 - announced)} was predicted"
    near = max(CONFIRMED, min(AS_ANNOUNCED * announced, 0.5 * (1.0 + announced)))  # half of what was to go, at least
    if announced > REFUTED:
        return _of_little(announced, over_announced, sentence)
    if share.left <= near or chi_square <= AT_NOISE:
        return "confirmed", sentence
    far = max(REFUTED, AS_ANNOUNCED * announced)
    if share.ci95[0] > far:
        return "refuted", f"{sentence}. If this effect were the cause, it would have been cancelled"
    return "partly", f"{sentence}. The rest has another cause"


def _numbers_or_name(
    plan: ProofPlan, recording: Recording, total: EffectProof, single: Mapping[str, EffectProof]
) -> tuple[EffectProof, dict[str, EffectProof]]:
    """What would be refuted, but explains the runs without compensation once its numbers are fitted anew, is partly so.

    A compensation by wrong numbers (of the damping, say, on which the ring depends) fails under the right name too.
    """
    plain = {one.planned.name for one in plan.runs if one.variant == PLAIN}
    runs = [run for run in recording.runs if run.name in plain]
    model = plan.models[ALL]
    out = dict(single)
    for name, one in single.items():
        if one.status != "refuted":
            continue
        without = replace(model, effects={n: v for n, v in model.effects.items() if n != name})
        left = explained_left(runs, model, without, recording.noise)
        if left <= MAX_REFITTED_SHARE:
            why = (
                f"{one.why.split('. ')[0]}. After refitting, however, the effect explains all but {_percent(left)} of "
                "the error without compensation: its parameters, or J, C and K, are inaccurate. Identify again from "
                "all runs"
            )
            out[name] = replace(one, status="partly", why=why)
    if total.status == "refuted" and not any(one.status == "refuted" for one in out.values()):
        worst = next((one for one in out.values() if one.status == "partly"), None)
        total = replace(total, status="partly", why=worst.why if len(out) == 1 and worst else total.why)
    return total, out


def _of_little(announced: float, over_announced: float, sentence: str) -> tuple[ProofStatus, str]:
    """Of a name of which by its own model most stays."""
    if over_announced > UNEXPLAINED_ERROR_RATIO:
        return (
            "refuted",
            f"the error without compensation is {over_announced:.2g} times the error that this effect predicts",
        )
    return "cannot be told", f"{sentence}. A compensating torque cannot cancel more of it"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if abs(share) < 0.995 else f"{100.0 * share:.1f} %"


def _interval(share: Share) -> str:
    low, high = share.gone_ci95
    return f"95 % interval {100.0 * low:.0f} to {100.0 * high:.0f} %"


def _compared(
    plan: ProofPlan, sets: list[str], found: Found, total: EffectProof, single: Mapping[str, EffectProof],
    rivals: Mapping[str, EffectProof],
) -> tuple[EffectProof, dict[str, EffectProof], dict[str, EffectProof]]:  # fmt: skip
    """With the worse of a name and its rival refuted where what they leave differs by more than chance.

    Both open where it does not: then neither is confirmed against the other.
    """
    single, out = dict(single), {}
    for pair, rival in rivals.items():
        effect, name = pair.split(" / ")
        if not rival.sets:  # none was played to its end
            out[pair] = rival
            continue
        ratio, low, high = _ratio(plan, pair, sets, found)
        reason = (
            f"the error left by compensating {plain_words(name)} is {ratio:.2g} times that of {plain_words(effect)}"
        )
        worse, model = (rival, plan.models[pair]) if ratio > 1.0 else (total, plan.models[ALL])
        if low <= 1.0 <= high or not _material(ratio, worse, model):
            why = f"{reason}: within chance, noise and what was announced to remain"
            out[pair] = replace(rival, status="cannot be told", why=why)
            if effect in single and single[effect].status == "confirmed":
                single[effect] = replace(single[effect], status="cannot be told", why=f"confirmed, but {why}")
        elif ratio > 1.0:
            out[pair] = replace(rival, status="refuted", why=reason)
        else:
            out[pair] = rival
            if effect in single:
                single[effect] = replace(single[effect], status="refuted", why=reason)
    return total, single, out


def _material(ratio: float, worse: EffectProof, model: Platform) -> bool:
    """Whether what two models leave differs by more than a tenth, and speaks against the worse of them.

    It does not where that leaves no more than noise. Nor where its effects hold the platform anywhere in a band before
    a run (friction, a gap) and it is confirmed by itself: what stays of it then is as large as chance has it.
    """
    by_chance = any(effects.get(name).rests_within_rad is not None for name in model.effects)
    expected = by_chance and worse.status == "confirmed"
    differs = abs(np.log(ratio)) > np.log(MIN_ERROR_RATIO)
    return bool(differs and not expected and _reduced_chi_square(worse.sets) > AT_NOISE)


def _ratio(plan: ProofPlan, pair: str, sets: list[str], found: Found) -> tuple[float, float, float]:
    """What a rival leaves over what the name leaves (root mean square, noise included), with its 95 % interval."""
    own: list[Array] = []
    other: list[Array] = []
    for name in sets:
        if (name, pair) not in found:
            continue
        duration_s = plan.of(name, PLAIN).duration_s
        for deviations, key in ((own, ALL), (other, pair)):
            squares, counts = found[name, key].squares(duration_s)
            deviations.append(squares / np.maximum(counts, 1.0) + found[name, key].noise ** 2)
    if not own:
        return 1.0, 0.0, np.inf
    a, b = np.concatenate(own), np.concatenate(other)
    total = float(np.log(np.sum(b) / np.sum(a)))
    rest = np.log((np.sum(b) - b) / (np.sum(a) - a))
    spread = float(np.sqrt((len(rest) - 1) / len(rest) * np.sum((rest - np.mean(rest)) ** 2)))
    half = NORMAL_95 * spread
    low, middle, high = (float(np.exp(0.5 * x)) for x in (total - half, total, total + half))
    return middle, low, high


def _told_beforehand(name: str, one: EffectProof) -> EffectProof:
    return replace(one, stays=effects.get(name).stays)


def _lines(name: str, plan: ProofPlan, found: Found) -> ProofLines:
    a, b = found[name, PLAIN], found[name, ALL]
    time_s = a.time_s[(a.time_s >= b.time_s[0]) & (a.time_s <= b.time_s[-1])]
    without = np.where(a.keep, a.error, np.nan)
    better = np.where(b.keep, b.error, np.nan)
    return ProofLines(name, time_s, np.interp(time_s, a.time_s, without), np.interp(time_s, b.time_s, better))
