"""Which of several effects is named that the data part hardly or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from identify.likelihood.fit import Fit
from identify.runs.measured_channels import simplicity
from identify.select.evidence import MAX_TRUSTED_INFLATION, Evidence, EvidenceModel
from rig import effects
from rig.effects.base import Place

MIN_RICHER_WEIGHT_GAIN = 0.05  # of the disturbance: what a richer effect carries besides, where nothing else is sure
SPECIAL = 0.8  # of the fall of the cost with a richer effect, parameters paid for: its special case is preferred


def simplest(weigher: EvidenceModel, fits: Mapping[str, Fit]) -> str:
    """Of candidates that do as well: no channel, fewest parameters, least torque left on held-out samples.

    Torque cannot judge a lag of the sensor, which has none: among such the likelier goes first.
    """
    torqueless = any(effects.get(n).place is Place.SENSOR for n in fits)

    def left(name: str) -> float:
        fit = fits[name]
        return fit.penalised if torqueless else weigher.left(weigher.in_torque(fit))

    return min(fits, key=lambda n: (simplicity(n), len(fits[n].names), left(n), n))


def no_possible_gain(seen: Mapping[str, Evidence], rich: str, close: Sequence[str], more: float) -> bool:
    """Whether an effect holds a simpler one and is no likelier, nor will be with ``more`` times the samples."""
    return any(
        (seen[rich].gain - seen[n].gain) * more < seen[rich].price - seen[n].price
        for n in effects.get(rich).nests if n in close
    )  # fmt: skip


def prefers_special_case(special: Evidence, rich: Evidence) -> bool:
    """Whether a special case is taken before the richer effect that holds it.

    It is if most of the fall of the cost is its own; and where the likelihood cannot be trusted, if it carries as much
    torque. Inflations are left out: those of two that are nearly alike differ by chance.
    """
    as_heavy = rich.inflation >= MAX_TRUSTED_INFLATION and special.weight > rich.weight - MIN_RICHER_WEIGHT_GAIN
    return explains_most(special, rich) or as_heavy


def explains_most(special: Evidence, rich: Evidence) -> bool:
    """Whether most of the fall of the cost with an effect is that of its special case."""
    return special.gain - special.price > SPECIAL * (rich.gain - rich.price)
