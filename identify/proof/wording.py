"""The proof in words: what is played and what will stay, what came of it."""

from __future__ import annotations

from collections.abc import Iterator

from identify.proof.compensation import not_cancelled
from identify.proof.plan import ALL, ProofPlan, pair_of
from identify.proven import EffectProof, LateTicks, Proof
from identify.wording import capital, joined, plain
from rig import effects
from rig.platform import Platform

NOTABLE = 0.005  # share that is announced to stay, below which nothing is said


def plan_lines(plan: ProofPlan, model: Platform, rest_s: float = 0.0) -> list[str]:
    """What is going to be played and what will stay, before anything moves; ``rest_s`` is the rest asked for."""
    kinds = 1 + len(plan.variants)
    names = joined([plain(n) for n in model.effects if effects.get(n).cancelled_by_torque]) or "nothing"
    lines = [
        f"Proof: {len(plan.set_names)} set(s), each played {kinds} times: without compensation, and with the torque "
        f"that cancels {names} by the identified model."
    ]
    for variant in plan.variants:
        for name, (left, _) in plan.announced[variant].items():
            if left > NOTABLE:
                lines.append(f"  {name}: about {percent(left)} of the error {_of(variant)} will remain")
    lines += [
        f"  {capital(plain(name))}: too small to be seen beside what remains of the others, so no set tests it alone"
        for name in plan.too_small
    ]
    for name in model.effects:
        effect = effects.get(name)
        if effect.cancelled_by_torque and effect.stays:
            lines.append(f"  {capital(plain(name))}: {effect.stays}")
    lines += [f"  {capital(plain(name))} is not compensated: {why}" for name, why in not_cancelled(model).items()]
    lines += [
        f"  {name}: reduced to {100 * scale:.1f} % to stay within the limits with compensation"
        for name, scale in plan.torque_scale.items()
    ]
    if plan.rest_s > rest_s:
        lines.append(
            f"  The rests between the runs last {plan.rest_s:.1f} s in place of {rest_s:g} s: by the model the "
            "platform rings that long"
        )
    return lines


def _of(variant: str) -> str:
    if variant == ALL:
        return "against the linear model"
    without, _ = pair_of(variant)
    return f"of {plain(without)}" if " / " not in variant else f"with {plain(variant.split(' / ')[1])}"


def lines(proof: Proof) -> list[str]:
    """What the proof found, one sentence each."""
    return [*proof.earlier, *_found(proof)]


def _found(proof: Proof) -> Iterator[str]:
    if proof.excluded and not proof.effects:
        yield _left_out(proof)
        return
    yield _sentence("All together" if len(proof.effects) > 1 else "The compensated model", proof.total)
    if len(proof.effects) > 1:
        for name, one in proof.effects.items():
            yield _sentence(capital(plain(name)), one)
    else:
        for name, one in proof.effects.items():
            if one.status != proof.total.status:
                yield _sentence(capital(plain(name)), one)
    for pair, one in proof.rivals.items():
        effect, rival = pair.split(" / ")
        yield _sentence(f"{capital(plain(rival))} instead of {plain(effect)}", one)
    if proof.late is not None:
        yield _late(proof.late, proof.total.announced_left)
    for name, why in proof.not_cancelled.items():
        yield f"{capital(plain(name))} was not compensated: {why}."
    if proof.excluded:
        yield _left_out(proof)


def _late(late: LateTicks, announced_left: float) -> str:
    """How many ticks were late, and what of the rest that may explain."""
    said = f"The torque was late in {late.late} of the {late.ticks} ticks of the compensated runs"
    if late.reproduced is None:
        return f"{said}; no more than the sensor's noise remained."
    also = f", beside the {percent(announced_left)} that was predicted to remain" if announced_left > NOTABLE else ""
    return (
        f"{said}. Given the torque as it was played, the identified model reproduces {percent(late.reproduced)} of the "
        f"error that remained: as much of it may be due to late ticks{also}."
    )


def _left_out(proof: Proof) -> str:
    names = capital(joined([plain(n) for n in proof.excluded]))
    return f"{names}: excluded; the search was repeated on all data, including the proof's."


def _sentence(who: str, one: EffectProof) -> str:
    stays = f" ({one.stays})" if one.stays and one.announced_left > NOTABLE else ""
    return f"{who}: {one.status}. {capital(one.why)}{stays}."


def percent(share: float) -> str:
    """A share with the digits that it deserves."""
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.1f} %"
