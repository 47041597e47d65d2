"""When a model is accepted: what is left and goes with something must be immaterial, and no error may grow unsaid."""

from __future__ import annotations

from identify.results import Disturbance, ModelResult
from identify.wording import SYMBOLS, joined, number
from rig.config.identify import AcceptConfig
from rig.platform import TERMS

GROWN = 1.02  # times the declared model's error: less is chance


def too_much_left(left: Disturbance, accept: AcceptConfig, axis: str) -> list[str]:
    """Why what is left is material, one sentence a limit; nothing where it is immaterial."""
    if not left.depends_on:
        return []
    torque = "force" if axis == "linear" else "torque"
    on = joined(list(dict.fromkeys(d.on for d in left.depends_on)))
    out = []
    if left.material_percent > accept.torque_percent:
        out.append(
            f"what is left goes with {on} and is {number(left.material_percent, 2)} % of the {torque}; "
            f"{number(accept.torque_percent, 2)} % is allowed (identify.accept.torque_percent)"
        )
    for name in TERMS:
        moved, most = left.moves_percent.get(name, 0.0), getattr(accept, f"{name}_percent")
        if moved > most:
            out.append(
                f"what is left goes with {on} and moves {SYMBOLS[name]} by {number(moved, 2)} %; "
                f"{number(most, 2)} % is allowed (identify.accept.{name}_percent)"
            )
    return out


def grown(before: ModelResult, after: ModelResult | None) -> str:
    """Why an error in the table grew although the model is better; empty where none did."""
    if after is None:
        return ""
    old, new = before.error.holdout_rate_rms, after.error.holdout_rate_rms
    if old is None or new is None or new <= GROWN * old:
        return ""
    return (
        "The held-out free run is further off than that of the declared model: over a whole run a torque that was not "
        "recorded adds up, and how far it leads astray says little of the model. The torque residual decided."
    )
