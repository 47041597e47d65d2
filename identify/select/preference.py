"""Which of several effects, and of two searches' models, is preferred that the data part hardly or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from identify.diagnose.torque_fit import TorqueFit
from identify.likelihood.fit import Fit
from identify.runs.measured_channels import simplicity
from identify.select.evidence import MAX_TRUSTED_INFLATION, Evidence, EvidenceModel
from identify.select.torque_search import TorqueSearch
from rig import effects
from rig.effects.base import Place

MIN_RICHER_WEIGHT_GAIN = 0.05  # of the disturbance: what a richer effect carries besides, where nothing else is sure
CLEARLY_LESS, ABOUT_AS_MUCH = 0.75, 1.25  # times the power that prediction error's model leaves on held-out samples
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


def explains_most(plain: Evidence, likelier: Evidence) -> bool:
    """Whether one effect, a special case or a rival, makes most of the fall of the cost that a likelier one makes."""
    return plain.gain - plain.price > SPECIAL * (likelier.gain - likelier.price)


def leaves_less(search: TorqueSearch, best: TorqueFit, trial: TorqueFit, depends: bool) -> bool:
    """Whether the model that the search in torque found stands in place of prediction error's.

    On samples not fitted it has to leave clearly less. Where what is left ``depends`` on something, prediction error
    lacks an effect or has a wrong one, and about as much with fewer parameters is enough, or less with as many.
    """
    ratio, more = search.left(best) / search.left(trial), len(best.values) - len(trial.values)
    enough = (ratio < ABOUT_AS_MUCH and more < 0) or (ratio < 1.0 / ABOUT_AS_MUCH and more == 0)
    return ratio < CLEARLY_LESS or (depends and enough)


def is_more_flexible(best: TorqueFit, trial: TorqueFit) -> bool:
    """Whether a model has a lag of the drive besides, or beside what was found an effect that fits almost anything.

    Where the likelihood can be trusted it knows of both: it has seen how the platform answers, sample by sample.
    """
    found = trial.structure.effects
    added = [effects.get(e) for e in best.structure.effects if e not in found]
    return any(e.place is Place.DRIVE or (bool(found) and e.is_flexible) for e in added)


def follows_nothing_freely(best: TorqueFit, trial: TorqueFit) -> bool:
    """Whether a model has nothing but stiff effects besides: none that fits almost anything, and no lag of the drive.

    What such a model leaves on held-out samples is no matter of how freely it follows: where another leaves a multiple,
    that is no disturbance. A further wave of a kind that the other has, too, follows no more freely than that.
    """
    kinds = {effects.first_of(e) for e in trial.structure.effects}
    added = [effects.get(e) for e in best.structure.effects if effects.first_of(e) not in kinds]
    return not any(e.place is Place.DRIVE or e.is_flexible for e in added)
