"""What a proof says of right names, wrong names and rivals.

python -m benchmarks.proof.run effects [--seeds 3] [--effect NAME ...]     every effect that is cancelled, at 2 to 5 %
python -m benchmarks.proof.run emulated [--seeds 3] [--effect NAME ...]    the same on emulated devices in step
python -m benchmarks.proof.run wrong [--campaigns 20]                      a wrong name forced in
python -m benchmarks.proof.run rivals [--campaigns 20]                     a name and its rival, both played
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping

import numpy as np

from benchmarks.proof import emulated, rigs
from benchmarks.proof.rigs import SHAPES, SMOOTH, Outcome, Player, campaign, config_of, fitted, proved, sized
from identify.proven import EffectProof, ProofSet
from rig import effects
from rig.errors import RigError
from rig.platform import Platform

SHARES = (0.02, 0.05)  # of the torque
# A hidden effect and what is declared in its place: none of them holds the true one as a special case.
WRONG = (
    ("coulomb_friction", "quadratic_damping"), ("coulomb_friction", "cubic_stiffness"),
    ("coulomb_friction", "torque_delay"), ("coulomb_friction", "directional_damping"),
    ("quadratic_damping", "coulomb_friction"), ("quadratic_damping", "backlash"),
    ("cubic_stiffness", "coulomb_friction"), ("cubic_stiffness", "quadratic_stiffness"),
    ("cubic_stiffness", "torque_deadzone"), ("quadratic_stiffness", "cubic_stiffness"),
    ("quadratic_stiffness", "coulomb_friction"), ("bilinear_stiffness", "coulomb_friction"),
    ("bilinear_stiffness", "cubic_stiffness"), ("cogging", "coulomb_friction"), ("cogging", "cubic_stiffness"),
    ("torque_deadzone", "cubic_stiffness"), ("torque_deadzone", "quadratic_damping"), ("creep", "quadratic_stiffness"),
    ("hysteresis", "cubic_stiffness"), ("presliding_friction", "cubic_stiffness"),
)  # fmt: skip
# A hidden effect and a rival: the first ones do nearly the same along these sets, the last ones exactly the same.
RIVALS = (
    ("coulomb_friction", "presliding_friction"), ("presliding_friction", "coulomb_friction"),
    ("stribeck_friction", "coulomb_friction"), ("cubic_stiffness", "backlash"), ("backlash", "cubic_stiffness"),
    ("torque_delay", "actuator_lag"), ("actuator_lag", "torque_delay"), ("hysteresis", "presliding_friction"),
    ("unbalance", "cubic_stiffness"), ("torque_deadzone", "coulomb_friction"),
)  # fmt: skip
HEAD = "| hidden | model | seed | verdict | left, % | 95 % | announced, % | before / noise | after | travel / limit |"
RULE = "|---|---|---|---|---|---|---|---|---|---|"


def over_noise(sets: tuple[ProofSet, ...], which: str) -> float:
    """Root mean square error over all sets, over the noise."""
    return float(np.sqrt(sum(getattr(s, which) ** 2 for s in sets) / sum(s.noise**2 for s in sets)))


def row(hidden: str, model: str, seed: int, outcome: Outcome, one: EffectProof | None = None) -> str:
    """A line of a table."""
    if outcome.proof is None:
        return f"| {hidden} | {model} | {seed} | {outcome.why} | | | | | | |"
    total = one or outcome.proof.total
    left = "-" if total.share is None else f"{100 * total.share.left:.1f}"
    interval = "-" if total.share is None else " to ".join(f"{100 * x:.1f}" for x in total.share.ci95)
    return (
        f"| {hidden} | {model} | {seed} | {total.status} | {left} | {interval} | {100 * total.announced_left:.1f} | "
        f"{over_noise(total.sets, 'error_without'):.1f} | {over_noise(total.sets, 'error_compensated'):.2f} | "
        f"{outcome.most_travel:.2f} |"
    )


def one_proof(hidden: str, declared: str, seed: int, player: Player = rigs.play) -> Outcome:
    """A campaign with ``hidden`` in it, a model with ``declared`` fitted to it, and its proof."""
    rng = np.random.default_rng([seed, *hidden.encode()])
    values = sized(hidden, float(rng.uniform(*SHARES)), rng)
    config = config_of({hidden: values}, seed)
    try:
        recording = campaign(config, seed, player)
    except RigError as error:
        return Outcome(None, None, f"campaign stopped: {str(error)[:70]}")
    start = _start(hidden, declared, values, rng)
    found = fitted(recording, declared, start)
    model = found.final.platform
    if model is None or declared not in model.effects:
        return Outcome(model, None, "dropped by the identification")
    model = rigs.with_known_scale(model, values.get("scale", 1.0))
    return proved(config, recording, model, seed, found.noise_floor.holdout_rate_rms, player=player)


def _start(hidden: str, declared: str, values: Mapping[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Where the fit begins: a fifth off the truth, or the usual size of a wrong effect."""
    begin = values if hidden == declared else SHAPES[declared]
    return {k: float(v) * float(rng.uniform(0.8, 1.2)) for k, v in begin.items()}


def effects_table(names: list[str], seeds: int, player: Player) -> None:
    """Every effect, each under its own name."""
    print(HEAD, RULE, sep="\n")
    met, noise_met, counted, smooth = 0, 0, 0, 0
    for name in names:
        for seed in range(1, seeds + 1):
            outcome = one_proof(name, name, seed, player)
            print(row(name, name, seed, outcome), flush=True)
            if outcome.proof is None or outcome.proof.total.share is None:
                continue
            total = outcome.proof.total
            counted += 1
            met += bool(total.share is not None and total.share.left <= max(0.10, 1.2 * total.announced_left))
            if name in SMOOTH:
                smooth += 1
                noise_met += over_noise(total.sets, "error_compensated") <= 1.2
    print(f"\nat most 10 % left, or the share announced: {met} of {counted}; smooth ones within 1.2 noise: ", end="")
    print(f"{noise_met} of {smooth}")


def wrong_table(campaigns: int) -> None:
    """A wrong name forced in."""
    print(HEAD, RULE, sep="\n")
    said: list[str] = []
    for number in range(campaigns):
        hidden, declared = WRONG[number % len(WRONG)]
        outcome = one_proof(hidden, declared, 1 + number)
        said.append(outcome.proof.total.status if outcome.proof is not None else "no proof")
        print(row(hidden, declared, 1 + number, outcome), flush=True)
    print(f"\nrefuted: {said.count('refuted')} of {len(said)}; {_counts(said)}")


def rivals_table(campaigns: int) -> None:
    """The right name and a rival, both fitted to the same campaign and both played."""
    print("| hidden | rival | seed | name | rival | told |", "|---|---|---|---|---|---|", sep="\n")
    said: list[str] = []
    for number in range(campaigns):
        hidden, rival = RIVALS[number % len(RIVALS)]
        name, other, told = one_pair(hidden, rival, 1 + number)
        right = name == "confirmed" and other == "refuted"
        said.append("right" if right else "wrong" if name == "refuted" else "open" if name.startswith("c") else name)
        print(f"| {hidden} | {rival} | {1 + number} | {name} | {other} | {told} |", flush=True)
    print(f"\n{_counts(said)} of {len(said)}")


def one_pair(hidden: str, rival: str, seed: int) -> tuple[str, str, str]:
    """The verdict on the right name, on its rival, and the sentence that tells them apart."""
    rng = np.random.default_rng([seed, *hidden.encode()])
    values = sized(hidden, float(rng.uniform(*SHARES)), rng)
    config = config_of({hidden: values}, seed)
    try:
        recording = campaign(config, seed)
    except RigError as error:
        return "no proof", "no proof", str(error)[:60]
    models: list[Platform] = []
    noise = 0.0
    for name in (hidden, rival):
        found = fitted(recording, name, _start(hidden, name, values, rng))
        model = found.final.platform
        if model is None or name not in model.effects:
            return "no proof", "no proof", f"{name} was dropped by the identification"
        models.append(model)
        noise = noise or found.noise_floor.holdout_rate_rms  # of the model that is compensated
    outcome = proved(config, recording, models[0], seed, noise, {f"{hidden} / {rival}": models[1]})
    if outcome.proof is None:
        return "no proof", "no proof", outcome.why
    one = outcome.proof.rivals[f"{hidden} / {rival}"]
    return outcome.proof.effects[hidden].status, one.status, one.why


def _counts(said: list[str]) -> str:
    return ", ".join(f"{said.count(word)} {word}" for word in dict.fromkeys(said))


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("table", choices=("effects", "emulated", "wrong", "rivals"))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--campaigns", type=int, default=20)
    parser.add_argument("--effect", action="append", choices=tuple(SHAPES), help="repeatable")
    asked = parser.parse_args()
    began = time.perf_counter()
    if asked.table in ("effects", "emulated"):
        player = rigs.play if asked.table == "effects" else emulated.play
        names = asked.effect or [n for n in SHAPES if effects.get(n).cancelled_by_torque]
        effects_table(names, asked.seeds, player)
    else:
        (wrong_table if asked.table == "wrong" else rivals_table)(asked.campaigns)
    print(f"{time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    main()
