"""What of the residual torque speaks against acceptance, one of the reasons in ``conclusion``; an error that grew."""

from __future__ import annotations

from dataclasses import replace

from identify.residual import Disturbance
from identify.results import ModelResult
from identify.wording import SYMBOLS, depends_on, joined, number
from rig.config.identify import AcceptConfig
from rig.platform import TERMS

MAX_ERROR_GROWTH = 1.02  # times the declared model's error: less is chance


def of_reported(left: Disturbance, model: ModelResult) -> Disturbance:
    """Without what it does to parameters that are not reported."""
    return replace(left, moves_percent={k: v for k, v in left.moves_percent.items() if k in model.parameters})


def reasons_against_disturbance(left: Disturbance, accept: AcceptConfig, axis: str) -> list[str]:
    """Why the residual torque is material, one sentence a limit; nothing where it is immaterial."""
    if not left.depends_on:
        return []
    torque = "force" if axis == "linear" else "torque"
    on = joined(list(dict.fromkeys(depends_on(d.on, axis) for d in left.depends_on)))
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
    return out


def grown(before: ModelResult, after: ModelResult | None) -> str:
    """Why an error in the table grew although the model is better; empty where none did."""
    if after is None:
        return ""
    old, new = before.error.holdout_rate_rms, after.error.holdout_rate_rms
    if old is None or new is None or new <= MAX_ERROR_GROWTH * old:
        return ""
    return (
        "The final model's held-out error in free run is larger than the declared model's. Over a whole run, a torque "
        "that was not recorded accumulates, so this error says little about the model; the torque residual decided."
    )
