"""The runs of a proof: every set without and with compensation, drift shared, within the limits of the machine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from identify.proof.compensation import cancelled, compensated
from identify.proof.deviation import deviation, share_left, simulated_run
from identify.proof.drive import Drive
from identify.proof.seen import expected_peaks
from identify.proof.standing import Standing, Standings, rest_needed_s
from rig import effects
from rig.errors import PreflightRefusal
from rig.excitation import PlannedSet
from rig.platform import Platform
from rig.preflight import Peaks, predict
from rig.recording.run import Run

ALL, PLAIN = "all", "plain"
MIN_TORQUE_SHARE = 0.02  # share of a set's torque below which it is not worth playing
PLANNING_ATTEMPTS = 12  # torques of one set that are tried, each smaller than the one before
# Of the travel and the rate that a campaign may use. A compensated platform is damped less than before, so that it
# rings on from wherever friction or a gap held it when the set began: with 1 N m on 681 N m/rad that took 0.25 deg of a
# travel of 10 deg (`rig prove` on the default campaign), and the guard adds what the gyro may have drifted.
RESERVE = 0.92
# Share left, beyond the one announced, from which a name explains less than half of the error's power.
REFUTED = 0.7
BACK_OFF = 0.98  # below what the pre-flight allows, for a compensation that does not shrink in proportion


@dataclass(frozen=True)
class PlannedRun:
    """One run of a proof.

    ``variant`` is "plain", "all" (all effects compensated), the name of the effect that alone is not, or
    "effect / rival" where a rival is compensated in the place of a name.
    """

    set: str
    variant: str
    planned: PlannedSet


class Announced(NamedTuple):
    """By a model's own account: the share of the error that stays, and the error without compensation (rms)."""

    left: float
    error: float


@dataclass(frozen=True)
class ProofPlan:
    """What a proof plays, and what its model says will come of it.

    Parameters
    ----------
    runs
        In the order in which they are played.
    models
        The model behind each variant.
    announced
        Variant -> set -> what its model says of it (see ``pair_of``).
    torque_scale
        Set -> the factor on its torque, where it had to be reduced.
    too_small
        Effect -> the share that the model announces to stay of what comes back without it alone: more than would refute
        it in every set, so that playing that tells nothing, and it is not played.
    rest_s
        How long the platform has to rest between two runs: what was asked for, or until its ring is lost in the noise.
    """

    runs: tuple[PlannedRun, ...]
    models: Mapping[str, Platform]
    announced: Mapping[str, Mapping[str, Announced]]
    torque_scale: Mapping[str, float] = field(default_factory=dict)
    too_small: Mapping[str, float] = field(default_factory=dict)
    rest_s: float = 0.0

    @property
    def sets(self) -> tuple[PlannedSet, ...]:
        """What the sequencer plays."""
        return tuple(run.planned for run in self.runs)

    def of(self, name: str, variant: str) -> PlannedSet:
        """The planned set of a variant of a set."""
        return next(run.planned for run in self.runs if run.set == name and run.variant == variant)

    @property
    def set_names(self) -> tuple[str, ...]:
        """The sets, in the order of the campaign."""
        return tuple(dict.fromkeys(run.set for run in self.runs))

    @property
    def variants(self) -> tuple[str, ...]:
        """All but the plain one."""
        return tuple(self.models)


def variants_of(model: Platform, rivals: Mapping[str, Platform]) -> dict[str, tuple[Platform, tuple[str, ...]]]:
    """Variant -> the model that compensates, and the effects that it leaves out."""
    names = cancelled(model)
    single = {name: (model, (name,)) for name in names} if len(names) > 1 else {}
    return {ALL: (model, ()), **single, **{name: (rival, ()) for name, rival in rivals.items()}}


Models = Mapping[str, tuple[Platform, tuple[str, ...]]]


def plan_proof(
    model: Platform, sets: Sequence[PlannedSet], allowed: Peaks, drive: Drive, *, angle: bool = False,
    rivals: Mapping[str, Platform] | None = None, prefix: str = "proof", recorded: Sequence[Run] = (),
    rest_s: float = 0.0, noise: float | None = None,
) -> ProofPlan:  # fmt: skip
    """Every set without and with compensation, and with each effect left out once where there are several.

    Each run is compensated from the state in which the one before it leaves the effects of its model. The order turns
    round from set to set, so that what drifts falls on all variants. Every run is held against the limits on its model,
    that of a rival on both, and by the recorded run of its set; where one breaks them the torque of the whole set is
    reduced.

    Parameters
    ----------
    model
        The identified platform: what is compensated.
    allowed
        Travel, rate and torque that a campaign may use; a proof leaves some of it (``RESERVE``).
    angle
        Whether an encoder reads the motion.
    rivals
        "effect / rival" -> the model with the rival in the place of the effect.
    recorded
        The campaign: a run of the name of a set tells how the platform moves in that set, whatever the model says.
    rest_s
        Between two runs, where the platform needs no longer one.
    noise
        Of the sensor, in which the ring of the run before has to be lost; where None it is left to ``rest_s``.

    Raises
    ------
    PreflightRefusal
        Where a set breaks a limit at any torque worth playing.
    """
    models = variants_of(model, rivals or {})
    allowed = allowed._replace(travel_deg=RESERVE * allowed.travel_deg, rate_deg_s=RESERVE * allowed.rate_deg_s)
    runs: list[PlannedRun] = []
    scales: dict[str, float] = {}
    announcements: dict[str, dict[str, Announced]] = {variant: {} for variant in models}
    if noise is not None:
        rest_s = rest_needed_s(sets, model, drive, angle, noise, rest_s)
    apart = {variant: of for variant, (of, _) in models.items() if of is not model or variant == ALL}
    stand = Standings.untouched(apart, drive, rest_s)
    for number, asked in enumerate(sets):
        run = next((r for r in recorded if r.name == asked.name), None)
        order = [PLAIN, *models] if number % 2 == 0 else [*reversed(models), PLAIN]
        made, factor = _within(asked, models, allowed, order, stand, prefix, run)
        if factor < 1.0:
            scales[asked.name] = factor
        runs += [PlannedRun(asked.name, variant, made[variant].planned) for variant in order]
        for variant, (of, _) in models.items():
            pair, own = [made[one] for one in pair_of(variant)], variant if variant in apart else ALL
            begins = [one.stand.found[own] for one in pair]
            announcements[variant][asked.name] = announced(
                of, pair[0].planned, pair[1].planned, drive, angle, (begins[0], begins[1])
            )
        stand = made[order[-1]].stand.after(made[order[-1]].planned)
    small = {
        variant: min(one.left for one in announcements[variant].values())
        for variant, (_, left_out) in models.items()
        if left_out and sets and all(one.left > REFUTED for one in announcements[variant].values())
    }
    return ProofPlan(
        tuple(run for run in runs if run.variant not in small),
        {v: of for v, (of, _) in models.items() if v not in small}, announcements, scales, small, rest_s,
    )  # fmt: skip


def pair_of(variant: str) -> tuple[str, str]:
    """The two variants whose errors say what one is worth: all effects and a rival against none, a name left out."""
    return (PLAIN, variant) if variant == ALL or " / " in variant else (variant, ALL)


def _within(
    asked: PlannedSet,
    models: Mapping[str, tuple[Platform, tuple[str, ...]]],
    allowed: Peaks,
    order: Sequence[str],
    stand: Standings,
    prefix: str,
    run: Run | None,
) -> tuple[dict[str, _Made], float]:
    """All variants of a set with the largest torque, of those tried, that passes on all; and the factor on it."""
    factor = 1.0
    for _ in range(PLANNING_ATTEMPTS):
        made = _made(asked.scaled(factor), models, order, stand, prefix)
        worst = min(_allowed_share(one.planned, variant, models, allowed) for variant, one in made.items())
        if run is not None:
            plain = asked.scaled(factor)
            seen = [expected_peaks(run, plain, one.planned, models[ALL][0]) for one in made.values()]
            worst = min(worst, *(_share_within(peaks, allowed) for peaks in seen if peaks is not None), 1.0)
        if worst >= 1.0:
            return made, factor
        factor *= BACK_OFF * worst
        if not factor > MIN_TORQUE_SHARE:
            break
    raise PreflightRefusal(
        f"{asked.name}: with compensation, even {100 * MIN_TORQUE_SHARE:g} % of this set's torque exceeds the limits "
        f"(travel {allowed.travel_deg:g} deg, rate {allowed.rate_deg_s:g} deg/s, torque "
        f"{allowed.torque_nm:g} N m); nothing was moved. Raise the limit in the section `limits` if the machine allows "
        "it."
    )


def _share_within(peaks: Peaks, allowed: Peaks) -> float:
    return min(limit / value for value, limit in zip(peaks, allowed, strict=True) if value > 0.0)


class _Made(NamedTuple):
    """A run, and how it finds the models."""

    planned: PlannedSet
    stand: Standings


def _made(
    plain: PlannedSet, models: Models, order: Sequence[str], stand: Standings, prefix: str
) -> dict[str, _Made]:  # fmt: skip
    made: dict[str, _Made] = {}
    for number, variant in enumerate(order):
        if number:
            stand = stand.after(made[order[number - 1]].planned)
        if variant == PLAIN:
            made[variant] = _Made(replace(plain, name=f"{prefix}: {plain.name}"), stand)
            continue
        (model, left_out), begin = models[variant], stand.found.get(variant, stand.found[ALL])
        name = f"{prefix}: {plain.name}, {_words(variant)}"
        try:
            made[variant] = _Made(compensated(model, plain, name, stand.drive, left_out, begin), stand)
        except PreflightRefusal as refused:
            if " / " not in variant:
                raise
            raise PreflightRefusal(f"{refused} Leave out --rival to play the proof without this alternative.") from None
    return made


def _words(variant: str) -> str:
    if variant == ALL:
        return "compensated"
    return f"{variant.split(' / ')[1]} compensated" if " / " in variant else f"all but {variant}"


def _allowed_share(planned: PlannedSet, variant: str, models: Models, allowed: Peaks) -> float:
    """The factor on a run with which it stays within the limits, on its own model and on the identified one."""
    own = {id(model): model for model, _ in (models[ALL if variant == PLAIN else variant], models[ALL])}
    return min(predict(on, planned, allowed).scale for on in own.values())


def announced(
    model: Platform, plain: PlannedSet, better: PlannedSet, drive: Drive, angle: bool,
    begins: tuple[Standing | None, Standing | None] = (None, None),
) -> Announced:  # fmt: skip
    """What stays of the error against the linear model by the model's own account; nothing where there was none.

    Where an effect leaves open at which angle the platform rests, the mean square over all angles that it allows.
    """
    pairs = []
    for aside_rad in _rest_angles(model):
        one, other = (
            deviation(simulated_run(s, model, drive, angle, aside_rad, begin), s, model, NEGLIGIBLE_NOISE)
            for s, begin in zip((plain, better), begins, strict=True)
        )
        pairs.append((one, other, plain.duration_s))
    share = share_left(pairs)
    error = math.sqrt(sum(one.rms**2 for one, _, _ in pairs) / len(pairs))
    return Announced(share.left if share is not None else 0.0, error)


def _rest_angles(model: Platform) -> tuple[float, ...]:
    """Beside where the spring holds a platform: two with the mean square of all at which its effects let it rest.

    A platform that swings out stops anywhere in the band of a dry friction or a gap: on an even distribution, what
    grows with the square of the angle has its mean at band / sqrt(3) (Gauss-Legendre of two points).
    """
    jck = (model.inertia_kg_m2, model.damping_nm_s_rad, model.stiffness_nm_rad)
    known = [(effects.get(name), given) for name, given in model.effects.items()]
    band = sum(e.rests_within_rad((*jck, *e.values(given))) for e, given in known if e.rests_within_rad is not None)
    return (-band / math.sqrt(3.0), band / math.sqrt(3.0)) if band > 0.0 else (0.0,)


NEGLIGIBLE_NOISE = 1e-9  # noise of a simulated sensor in the unit of its channel: far below what any effect does
