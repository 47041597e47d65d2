"""Words that the tables on the terminal and those of the report share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identify.results import NoiseFloor

# Columns of the table of parameters: a number of rig.yaml, and two fits.
DECLARED_VALUE, DECLARED_FIT, FINAL_FIT = "declared value", "fit of declared model", "final fit"
BELOW_J_DEC, SEARCH_REPEATS = "objective below J_dec", "search repeats"
J_DEC = (
    "J_dec: the limit of the objective of the genetic search (Eq. 14), identify.j_dec; if that is left out, it follows "
    "from the noise floor."
)
OVER_THE_SETS = "standard deviation over the sets"
REPRODUCED = "held-out motion reproduced (NRMSE fit)"
SIMULATED = "Simulation error: the model runs freely over each run and is compared with the held-out samples."


def simulation_error(channel: str) -> str:
    """The error of a model that runs freely over held-out samples of a channel."""
    return f"simulation error, held-out {channel}"


def noise_floor_sentence(floor: NoiseFloor, info: Mapping[str, Any]) -> str:
    """What the errors hold of the sensor's noise, and what says how large it is; ``info`` is the recording's."""
    return (
        f"All errors include the sensor noise; the noise floor is what it alone leaves, {_according_to(floor, info)}."
    )


def _according_to(floor: NoiseFloor, info: Mapping[str, Any]) -> str:
    if floor.source == "estimated":
        return "as estimated from the recording"
    if info.get("played_on") == "simulated":
        return "as the simulated rig states it"
    return "as the gyro's driver states it" if "played_on" in info else "as stated (recorded.noise)"
