"""Quite another noise for a descent to go on from: the likeliest alone, one far off, far less of a disturbance.

Beside the right noise the likelihood is a quadratic in its logarithms, and a step finds it; far off it is not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from identify.likelihood.damped_step import begin_damping, step_down
from identify.likelihood.normal_equations import COST_TOLERANCE
from rig.arrays import Array
from rig.dynamics.gains import Noise

if TYPE_CHECKING:
    from identify.likelihood.descent import Descent
    from identify.simulate.shots import Shots

# Times the disturbance: how far below a model is looked at with parameters that follow.
CONTINUATION_LEVELS = (1e-3, 1e-6, 1e-10)
CONTINUATION_STEPS, MAX_GAP_RATIO = 20, 0.7  # steps in which they do, and what each of them leaves of the gap at most
MAX_STEPS_ALONE = 20  # of the noise alone
LARGE_DISTURBANCE = 2.0  # reduced chi-square: less of a disturbance is found step by step
NOISE_START_FACTORS = (  # times white density, slow variance and time constant: where else a noise is looked for
    (0.01, 1.0, 1.0), (10.0, 1.0, 1.0), (1.0, 0.01, 1.0), (1.0, 10.0, 1.0), (1.0, 0.1, 0.1), (1.0, 0.03, 0.01),
    (1.0, 1.0, 10.0),
)  # fmt: skip
# Times the time constant, with which a smooth disturbance stands for a rough one as large, and the other way round.
EXCHANGED_TIME_FACTORS = (0.1, 0.3, 1.0, 3.0)
# Of the rate, that a gyro's bias walks over a run: where else it is looked for.
BIAS_WALK_STARTS = (1e-6, 1e-5, 1e-4, 1e-3)
# Times torque and slow error of an encoder together: the rest is read white.
DISTURBANCE_START_FACTORS = (1e-4, 1e-3, 1e-2, 0.1)


def other_noise(descent: Descent, lower: bool = True) -> bool:
    """Whether a noise that is quite another one is likelier; if so the descent goes on from there.

    Beside the right one the likelihood is a quadratic in its logarithms; far off it is flat, or has a valley for
    a disturbance that is slow and another for one that is fast. ``lower``: far below is looked at, too.
    """
    before = descent.cost
    wanders = descent.problem.wanders and not descent.problem.gyro
    others: list[dict[str, float]] = [
        {"white": white, "slow": slow, "time_constant_s": time} for white, slow, time in NOISE_START_FACTORS
    ]  # fmt: skip
    others += [{"white": x, "slow": x, "smooth": x, "walk": x} for x in DISTURBANCE_START_FACTORS if wanders]
    if "walk" in descent.kinds and not wanders:
        others += [{"walk": descent.problem.bounds.walk(share) / descent.noise.walk} for share in BIAS_WALK_STARTS]
    for times in others:
        q = descent.noise
        _take_if_likelier(descent, replace(q, **{k: x * getattr(q, k) for k, x in times.items()}))
    q = descent.noise
    for factor in EXCHANGED_TIME_FACTORS:
        _take_if_likelier(
            descent, replace(q, slow=q.smooth, smooth=q.slow, time_constant_s=factor * q.time_constant_s)
        )  # fmt: skip
    if descent.alone:
        noise_alone(descent)
    if lower:
        without_disturbance(descent)
    begin_damping(descent)
    return descent.cost < before - COST_TOLERANCE


def noise_alone(descent: Descent) -> None:
    """Down to the nearest noise that is likeliest beside the parameters as they stand.

    A fit steps both together, which is quick where both are near. Far off, the noise has long curved valleys (less
    noise behind a gyro's low-pass, and all else more), and a step of both would be as short as the noise needs it.
    """
    begin_damping(descent)
    for _ in range(MAX_STEPS_ALONE):
        before = descent.cost
        if not (step_down(descent, descent.of_noise(), True, 0.0) and before - descent.cost > COST_TOLERANCE):
            break
    begin_damping(descent)


def _take_if_likelier(descent: Descent, noise: Noise) -> None:
    noise = descent.problem.bounds.within(noise)
    looks = descent.looks_at(descent.x, noise, descent.shots)
    cost = descent.cost_of(looks)
    if cost < descent.cost - COST_TOLERANCE:
        descent.noise, descent.looks, descent.cost = noise, looks, cost


def without_disturbance(descent: Descent, keeps: bool = False) -> bool:
    """Far less of a disturbance, if that is likelier once the parameters have followed; whether anything was likelier.

    A model that is right may otherwise stay where the disturbance explains all that is left, and the sensor has no
    noise: between the two lies a ridge. Parameters that have followed in vain are tried beside the noise as it stood
    where one ``keeps`` them: a wrong model's go astray.
    """
    if descent.reduced_chi_square() < LARGE_DISTURBANCE:
        return False
    here = descent.place()
    for factor in CONTINUATION_LEVELS:
        q = here[0]
        less = {kind: factor * getattr(q, kind) for kind in ("white", "slow", "smooth")}
        descent.noise = descent.problem.bounds.within(replace(q, **less))
        descent.looks = descent.looks_at(descent.x, descent.noise, descent.shots)
        descent.cost = descent.cost_of(descent.looks)
        begin_damping(descent)
        for _ in range(CONTINUATION_STEPS):
            gap = descent.cost - here[-1]
            if (
                not descent.try_step(False)
                or descent.cost < here[-1] - COST_TOLERANCE
                or descent.cost - here[-1] > MAX_GAP_RATIO * gap
            ):
                break
        if descent.cost < here[-1] - COST_TOLERANCE:
            return True
        x, shots = descent.x, descent.shots
        descent.go(here)
        if keeps and _goes_to(descent, x, shots):
            return True
    return False


def beside_another_noise(descent: Descent) -> bool:
    """Whether a model that leaves a large disturbance is likelier with less of it, or with another one.

    A first step of parameters that are far off may lead the noise into a valley where all that is wrong is disturbance,
    and no further step leads out: two models are compared where both have got out of it.
    """
    if descent.reduced_chi_square() < LARGE_DISTURBANCE:
        return False
    less = without_disturbance(descent, keeps=True)
    return other_noise(descent, lower=False) or less


def _goes_to(descent: Descent, x: Array, shots: list[Shots]) -> bool:
    """Whether other parameters are likelier beside the noise as it stands; if so the descent goes on from there."""
    looks = descent.looks_at(x, descent.noise, shots)
    cost = descent.cost_of(looks)
    if not cost < descent.cost - COST_TOLERANCE:
        return False
    descent.go((descent.noise, x, shots, looks, cost))
    return True
