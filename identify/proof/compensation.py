"""The torque that makes a platform move as its linear part alone would, from its model and before it moves.

    torque asked for = inverse of the drive (set + torque of the effects along the linear part's motion)

The motion is the response of J, C, K to the set; nothing is measured on the way (feedforward of the inverse model,
e.g. Olsson et al., "Friction models and friction compensation", Eur. J. Control 4, 1998).
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from identify.model.effect_torque import feeds_on_torque, torque_along
from identify.proof.drive import PARTS, Drive
from identify.proof.rounding import feedback, rounded
from identify.proof.standing import Standing
from identify.wording import joined, plain
from rig import effects
from rig.arrays import Array
from rig.dynamics import Motion, TorqueSignal, simulate
from rig.dynamics.equations import STEP_PHASE_RAD
from rig.effects.base import Effect, Place
from rig.errors import PreflightRefusal
from rig.excitation import CompensatedSet, HeldCommands, PlannedSet, TorqueTable
from rig.platform import Platform

# Of a torque that is read between the ticks by a spline: a jump of it is spread so far that the spline follows.
ROUNDED_TICKS = 0.75  # standard deviation, in ticks: -3 dB at 0.18 of the tick rate
GAUSSIAN_REACH_SIGMAS = 4.0  # standard deviations over which that reaches
FRICTION_ROUNDS = 4  # for friction that grows with its own compensation; each is smaller by its factor (at most 0.5)
SOFT = 2e-3  # of the largest rate: below it the sign of the rate is not foreseen


def linear_part(platform: Platform) -> Platform:
    """J, C and K alone, read by the same sensor: what the platform would be without what is compensated."""
    kept = {n: v for n, v in platform.effects.items() if effects.get(n).place is Place.SENSOR}
    return replace(platform, effects=kept)


def cancelled(platform: Platform) -> tuple[str, ...]:
    """The effects of a platform that a torque computed beforehand can take away, in the order of the model."""
    return tuple(n for n in platform.effects if effects.get(n).cancelled_by_torque)


def not_cancelled(model: Platform) -> dict[str, str]:
    """Effects of a model that a proof does not touch, and why."""
    return {
        name: effects.get(name).stays or _no_torque(name) for name in model.effects
        if not effects.get(name).cancelled_by_torque
    }  # fmt: skip


def _no_torque(name: str) -> str:
    read = effects.get(name).reads
    return (
        f"the readings of {read.name} are not known before the run" if read is not None else "no torque can cancel it"
    )


def compensated(
    platform: Platform, planned: PlannedSet, name: str, drive: Drive, left_out: Collection[str] = (),
    begin: Standing | None = None,
) -> PlannedSet:  # fmt: skip
    """A set together with the torque that cancels the effects of a platform, as a set of that name.

    Parameters
    ----------
    platform
        The model: what is cancelled is what it says, no more.
    planned
        The set as it is played without compensation.
    left_out
        Effects of the model that are not compensated.
    begin
        How the run finds the platform; as if nothing had moved it where None.
    """
    begin = begin or Standing.untouched(platform)
    active = [n for n in cancelled(platform) if n not in left_out]
    lead_s = _lead_s(platform, active, drive)
    count = round((planned.duration_s + lead_s) / drive.step_s)
    middles_s = drive.step_s * (np.arange(count) + 0.5)
    set_nm = _set_torque(planned, lead_s, drive)
    wanted = set_nm.at(middles_s)
    resisting = _resistance(platform, active, middles_s, _motion(platform, set_nm, middles_s, begin), wanted, begin)
    of_set = _through_drive(platform, active, wanted, drive.step_s)
    of_effects = _through_drive(platform, active, wanted + resisting, drive.step_s) - of_set
    if not np.all(np.isfinite(of_effects)):
        raise _runs_away(platform, name)
    apart = math.modf((drive.latency_s + _early_s(platform, active)) / drive.tick_s)[0]
    table = TorqueTable(
        drive.step_s, _as_played(_sooner(of_set, drive), _sooner(of_effects, drive), wanted, drive, apart)
    )
    commands = None
    if drive.hold == "zero_order" and drive.resolution_nm is not None:
        ticks_s = drive.tick_s * np.arange(round((planned.duration_s + lead_s) / drive.tick_s))
        exact = np.asarray(planned.torque(ticks_s - lead_s), dtype=float) + table.at(ticks_s)
        made_good = feedback(platform, drive.tick_s, planned.duration_s)
        commands = HeldCommands(drive.tick_s, rounded(exact, drive.resolution_nm, made_good))
    return CompensatedSet.of(planned, name, lead_s, table, _early_s(platform, active), drive.latency_s, commands)


def _runs_away(platform: Platform, name: str) -> PreflightRefusal:
    c, k = platform.damping_nm_s_rad, platform.stiffness_nm_rad
    names = joined([plain(n) for n in platform.effects])
    return PreflightRefusal(
        f"{name}: no compensating torque can be computed. By the model with {names} "
        f"(C = {c:.3g} N m s/rad, K = {k:.3g} N m/rad) the motion grows without bound; nothing was moved."
    )


def _set_torque(planned: PlannedSet, lead_s: float, drive: Drive) -> TorqueSignal:
    """The set as the drive plays it, on the clock of a run that begins ``lead_s`` before it."""
    count = math.ceil((planned.duration_s + lead_s) / drive.tick_s - 1e-9) + 2
    ticks_s = drive.tick_s * np.arange(count)
    return TorqueSignal(ticks_s, np.asarray(planned.torque(ticks_s - lead_s), dtype=float), drive.hold)


def _early_s(platform: Platform, active: list[str]) -> float:
    """By how much earlier than it is wanted the drive is asked for a torque."""
    ahead = [(effects.get(n), platform.effects[n]) for n in active]
    return sum(e.ahead_s(e.values(given)) for e, given in ahead if e.ahead_s is not None)


def _lead_s(platform: Platform, active: list[str], drive: Drive) -> float:
    """By how much earlier than the set its run begins, in whole ticks; a slope is known one tick ahead."""
    early = (drive.latency_s + _early_s(platform, active)) / drive.tick_s
    slope = 1.0 if any(effects.get(n).inverse is not None for n in active) else 0.0
    spread = 2.0 * GAUSSIAN_REACH_SIGMAS * ROUNDED_TICKS if drive.hold == "band_limited" else 0.0
    return math.ceil(early + slope + spread - 1e-9) * drive.tick_s


def _motion(platform: Platform, set_nm: TorqueSignal, time_s: Array, begin: Standing) -> Motion:
    """Of the linear part under a set, from where the model rests without torque."""
    half = 0.5 * (time_s[1] - time_s[0])
    moved = simulate(replace(platform, effects={}), half * np.arange(2 * len(time_s) + 1), set_nm, substeps=2)
    angle = moved.angle_rad + begin.angle_rad
    return Motion(angle[1::2], moved.rate_rad_s[1::2], moved.sensed_rate_rad_s[1::2])


def _resistance(
    platform: Platform, active: list[str], time_s: Array, motion: Motion, wanted_nm: Array, begin: Standing
) -> Array:  # fmt: skip
    """Torque of the effects on the shaft along a motion, less what the spring holds at rest, (n,)."""
    on_shaft = [n for n in active if effects.get(n).place in (Place.LOAD, Place.FRICTION)]
    total = np.zeros(len(time_s))
    for _ in range(FRICTION_ROUNDS if any(feeds_on_torque(n) for n in on_shaft) else 1):
        shaft = wanted_nm + total
        total = np.zeros(len(time_s))
        for name in on_shaft:
            total += along(platform, name, time_s, motion, shaft, begin)
    return total


def along(
    platform: Platform, name: str, time_s: Array, motion: Motion, torque_nm: Array, begin: Standing | None = None
) -> Array:  # fmt: skip
    """The resisting torque of one effect of a platform along a motion at even steps, zero as it began, (n,)."""
    begin = begin or Standing.untouched(platform)
    effect = effects.get(name)
    jck = (platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad)
    p = np.array([*jck, *effect.values(platform.effects[name])], dtype=float)
    step_s = float(time_s[1] - time_s[0])
    friction = effect.place is Place.FRICTION
    rate = np.abs(motion.rate_rad_s) if friction else motion.rate_rad_s
    out = np.zeros(len(time_s))
    z = begin.of(platform, name)
    torque_along(
        effect.kernel.address, motion.angle_rad, rate, time_s, torque_nm, step_s, z, _substeps(effect, p, step_s), p,
        False, 1.0, out,
    )  # fmt: skip
    if friction:
        return out * _direction(motion.rate_rad_s)
    return out - _at_rest(effect, p, begin.angle_rad, z)


def _substeps(effect: Effect, p: Array, step_s: float) -> int:
    fastest = effect.fastest_rad_s(tuple(p.tolist())) if effect.fastest_rad_s else 0.0
    return int(np.clip(math.ceil(step_s * fastest / STEP_PHASE_RAD), 1, 64))


def _direction(rate_rad_s: Array) -> Array:
    """The sign of a rate, its mean over the step around each value; less than one where nothing hardly moves."""
    across = 0.5 * np.abs(np.gradient(rate_rad_s))
    soft = SOFT * float(np.max(np.abs(rate_rad_s), initial=0.0)) + 1e-12
    return np.clip(rate_rad_s / np.maximum(across, soft), -1.0, 1.0)


def _at_rest(effect: Effect, p: Array, angle_rad: float, z: Array) -> float:
    """What an effect pulls at rest: the spring holds that, and it is no part of the motion."""
    out, at = np.zeros(1), np.array([angle_rad])
    none = np.zeros(1)
    torque_along(effect.kernel.address, at, none, none, none, 1.0, z, 1, p, False, 1.0, out)
    return float(out[0])


def _through_drive(platform: Platform, active: list[str], torque_nm: Array, step_s: float) -> Array:
    """The torque to ask for so that ``torque_nm`` comes out behind the drive, its filters undone from the last one."""
    for name in reversed(active):
        effect = effects.get(name)
        if effect.inverse is not None:
            torque_nm = effect.inverse(torque_nm, step_s, effect.values(platform.effects[name]))
    return torque_nm


def _sooner(torque_nm: Array, drive: Drive) -> Array:
    """The same, asked for earlier by what the drive takes to give it."""
    if drive.latency_s == 0.0:
        return torque_nm
    time_s = drive.step_s * np.arange(len(torque_nm))
    return np.interp(time_s + drive.latency_s, time_s, torque_nm, right=0.0)


def _as_played(of_set: Array, of_effects: Array, set_nm: Array, drive: Drive, apart: float) -> Array:
    """What is asked for less the set, (n,), all as means over even steps, as the drive can play it from each step on.

    A command that is held is the mean of what is wanted while it stands. A mean takes away from what bends, and that is
    given back: of the set, which is held itself from instants ``apart`` of a tick beside the commands, as much as a
    line between two ticks lacks there (apart (1 - apart) / 2 of the second difference); of the effects 1/12 of it.

    One that is read off a smooth curve is rounded by a Gaussian and what that takes away is given back once (twicing,
    Tukey 1977): 0.01 % are left at 3 % of the ticks' rate, and a jump is a spline's to follow.
    """
    if drive.hold == "zero_order":
        played = _unbent(_held(of_set), 0.5 * apart * (1.0 - apart)) + _unbent(_held(of_effects), 1.0 / 12.0)
        return played - set_nm
    more = of_set + of_effects - set_nm
    once = _rounded(more)
    twice = once + _rounded(more - once)
    return 0.5 * (twice + np.concatenate([[0.0], twice[:-1]]))


def _held(torque_nm: Array) -> Array:
    """The mean over one tick from each step on."""
    area = np.concatenate([[0.0], np.cumsum(torque_nm)])
    ends = np.minimum(np.arange(len(area)) + PARTS, len(area) - 1)
    return (area[ends] - area)[:-1] / PARTS


def _unbent(torque_nm: Array, factor: float) -> Array:
    """Less a factor of the second difference from tick to tick."""
    padded = np.pad(torque_nm, PARTS)
    return torque_nm - factor * (padded[2 * PARTS :] - 2.0 * torque_nm + padded[: -2 * PARTS])


def _rounded(torque_nm: Array) -> Array:
    out: Array = gaussian_filter1d(torque_nm, ROUNDED_TICKS * PARTS, truncate=GAUSSIAN_REACH_SIGMAS, mode="constant")
    return out
