"""Why a result is not accepted: every reason and its sentence; ``conclusion`` puts those that hold together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from identify.residual import Disturbance
from identify.results import GeneticRun, Identification, ModelResult
from identify.runs.sign_convention import signs
from identify.select.lags import PASSIVE_SIGMAS
from identify.wording import SYMBOLS, joined, number, percent, plain, quantities_of
from rig import effects
from rig.config.identify import AcceptConfig
from rig.effects.base import Place
from rig.platform import TERMS

INTERRUPTED = "the search was interrupted"
REJECTED_TOGETHER = (
    "rejected: together the effects that were found leave too much of the residual, and so does the declared model"
)
INTERRUPTED_NOTE = (
    "The search was interrupted; missing effects are not yet determined. Run identify-run on this recording again."
)
USUAL_CUTOFF_HZ = 50.0  # where the residual passed no low-pass
AT_LIMIT = 0.999  # of the largest value that a fit gives a parameter: there it would have gone on


def of_reported(left: Disturbance, model: ModelResult) -> Disturbance:
    """Without what it does to parameters that are not reported."""

    def reported(moves: Mapping[str, float]) -> dict[str, float]:
        return {k: v for k, v in moves.items() if k in model.parameters}

    without = {name: reported(moves) for name, moves in left.moves_without_percent.items()}
    return replace(left, moves_percent=reported(left.moves_percent), moves_without_percent=without)


def reasons_against_fit(searched: Sequence[GeneticRun], final: ModelResult) -> list[str]:
    """Sets that stay above J_dec (Eq. 14) though the search was repeated, and parameters that are not determined.

    Parameters
    ----------
    searched
        The genetic searches that have to reach J_dec.
    """
    above = [
        f"{g.name}: the objective {g.objective:.4g} is still above J_dec {g.j_dec:.4g} after {g.restarts} repeats"
        for g in searched if not g.accepted
    ]  # fmt: skip
    return [
        *above,
        *(f"{x.name} is not determined: {x.reason}" for x in final.not_determined),
        *_against_negative_damping(final),
        *_against_ends(final),
    ]


def _against_negative_damping(final: ModelResult) -> list[str]:
    """That a damping is negative, which no platform's is."""
    damping = next((p for n, p in final.parameters.items() if n.startswith("damping")), None)
    if damping is None or not damping.value < -PASSIVE_SIGMAS * damping.std_error:
        return []
    return [
        f"damping C is negative ({number(damping.value, 3)} {damping.unit}), and no passive platform's is: the model "
        "takes something else for damping, often a delay between torque and rate"
    ]


def _against_ends(final: ModelResult) -> list[str]:
    """Parameters of the drive or the sensor that end where they are no longer looked for: J, C and K go with them."""
    return [
        f"{plain(effect)}: {p.meaning} ends at {number(found.value, 3)} {found.unit}, as far as is looked; check "
        "the units and the time stamps of torque and rate, and a declared added_inertia_kg_m2"
        for effect, values in final.effect_parameters.items()
        if effects.get(effect).place in (Place.DRIVE, Place.SENSOR)
        for p in effects.get(effect).parameters
        if (found := values.get(p.name)) is not None
        and (found.value >= AT_LIMIT * p.high or (p.low > 0.0 and found.value <= p.low / AT_LIMIT))
    ]


def reasons_against_disturbance(left: Disturbance, accept: AcceptConfig, axis: str) -> list[str]:
    """Why the residual torque is material, one sentence a limit; nothing where it is immaterial."""
    torque = "force" if axis == "linear" else "torque"
    if not left.depends_on:
        return [
            f"without {plain(effect)} the fit would change {changes}, more than is allowed ({keys}), and held-out data "
            "are explained as well without it: the parameters are known once it is known whether this effect is there"
            for effect, changes, keys in _beyond(left, accept)
        ]
    on = quantities_of(left.depends_on, axis)
    out = []
    if left.material_percent > accept.torque_percent:
        out.append(
            f"the part of the residual {torque} that depends on the {on} is "
            f"{number(left.material_percent, 2)} % of the {torque}; {number(accept.torque_percent, 2)} % is allowed "
            "(identify.accept.torque_percent)"
        )
    for name in TERMS:
        moved, most = left.moves_percent.get(name, 0.0), getattr(accept, f"{name}_percent")
        if moved > most:
            out.append(
                f"fitting the part of the residual {torque} that depends on the {on} changes {SYMBOLS[name]} by "
                f"{number(moved, 2)} %; "
                f"{number(most, 2)} % is allowed (identify.accept.{name}_percent)"
            )
    out += [
        f"{plain(effect)} would change {changes}, more than is allowed ({keys}), and the data do not tell how much of "
        f"the {torque} that depends on the {on} is due to it"
        for effect, changes, keys in _beyond(left, accept)
    ]
    return out


def _beyond(left: Disturbance, accept: AcceptConfig) -> list[tuple[str, str, str]]:
    """Effects without which J, C or K differ by more than is allowed: each, by how much, and the keys that allow it."""
    out = []
    for effect, moves in left.moves_without_percent.items():
        beyond = {k: v for k, v in moves.items() if v > getattr(accept, f"{k}_percent")}
        if beyond:
            changes = joined([f"{SYMBOLS[k]} by {number(v, 2)} %" for k, v in beyond.items()])
            out.append((effect, changes, joined([f"identify.accept.{k}_percent" for k in beyond])))
    return out


def interrupted_reason(named: Sequence[str]) -> str:
    """Why the results of a search that somebody stopped are not accepted; ``named`` are the effects proven by then."""
    if not named:
        return f"{INTERRUPTED}; missing effects are not yet determined"
    proven = joined([plain(name) for name in named])
    verb = "was" if len(named) == 1 else "were"
    return f"{INTERRUPTED} after {proven} {verb} proven; whether more is missing is not yet determined"


def opposite_signs(found: Identification) -> bool:
    """Whether torque and motion were recorded with opposite sign conventions."""
    seen = signs(found.traces, found.final.error.lowpass_hz or USUAL_CUTOFF_HZ) if found.traces else None
    return seen is not None and seen.opposite


def unexplained_reason(chi_square: float, found: Identification) -> str:
    """Why a residual that stays is no matter of noise: in units of the sensor's noise, and of the signal.

    ``chi_square`` is the reduced one of the residual.
    """
    error, share = found.final.error, ""
    force = "force" if found.axis == "linear" else "torque"
    relative = error.holdout_torque_relative
    if relative is not None and math.isfinite(relative):
        share = f"{percent(100.0 * relative).lstrip('+')} of the {force}"
    elif error.holdout_fit_percent is not None and math.isfinite(error.holdout_fit_percent):
        share = f"{percent(100.0 - error.holdout_fit_percent).lstrip('+')} of the motion"
    size = f"{number(math.sqrt(chi_square), 3)} times the sensor's noise"
    amount = f"{share} ({size}, which is included)" if share else size
    acts = "no effect that was tried describes it"
    if found.verdict.left_open:
        acts = "the cause of a part of it is not determined (see the verdict)"
    return f"the model leaves {amount} unexplained: {acts}"
