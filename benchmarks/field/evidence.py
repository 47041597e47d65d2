"""Whether a record shows what was hidden, who else could pass for it, and how well J, C and K can be told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.field import rivals
from benchmarks.field.library import INSEPARABLE, LATE, LIBRARY, Scale
from benchmarks.field.oracle import (
    Filter,
    cleared,
    foreseen,
    kalman,
    motion_columns,
    recorded,
    slopes,
    torque_along,
    whitened,
    whole_steps,
)
from benchmarks.field.recording import Levels, Measured, Motion
from benchmarks.field.rigs import Rig, Unsuitable

TERMS = ("inertia", "damping", "stiffness")
ENERGY = 200.0  # chi-square that an effect, or what its best rival leaves of it, has to have
TIMES_LEFT = 0.7  # rms that the best library effect leaves of one outside the library, over the disturbance
LATE_ENERGY = 9.0  # chi-square from which the gyro's own low-pass may be named
MOST_ERROR_PERCENT = (0.5, 2.5, 0.5)  # bound of J, C, K: a quarter of what may pass as accepted
MOST_BOUNDS = 3.5  # error of the oracle itself over the bound, from which the bound is not sound
MOST_STUCK = 0.05  # share of a record from which the bound is not sound: a shaft that sticks tells nothing


@dataclass(frozen=True)
class Evidence:
    """``energy`` of each effect (chi-square beside all others), what its best rivals leave of it, and the bound."""

    energy: dict[str, float]
    rivals: dict[str, dict[str, float]]  # effect -> rival -> energy that parts them, the closest five
    alike: dict[str, list[str]]  # rivals that this record does not part
    allowed: list[str]  # names that are true of the rig though nothing of the kind was hidden
    bound: dict[str, float]  # standard error of J, C, K at best, SI units
    oracle: dict[str, float]  # error of J, C, K of one who knows the structure, from this very record, SI units
    bound_unsound: str  # why the bound is no measure here; empty: it is one
    whiteness: float  # rms of the oracle's innovations: 1 where its noise model is right


def weigh(
    rig: Rig, motions: Sequence[Motion], seen: Sequence[Measured], size: Levels, disturbance: float, scale: Scale,
    outside: bool,
) -> Evidence:  # fmt: skip
    """Judge a record by the generator's own knowledge.

    Raises
    ------
    Unsuitable
        Where an effect does not show, passes for another one, or J, C, K are not determined.
    """
    wrong = [recorded(rig, m, s) - m.asked for m, s in zip(motions, seen, strict=True)]
    error = np.concatenate([m.mean(x) for m, x in zip(motions, wrong, strict=True)])
    whole = np.concatenate([whole_steps(s.arrived) for s in seen])
    doubt = (_rms(error[whole]), _rms(error[~whole]))
    angle = np.concatenate([m.sampled(m.angle) - m.angle[m.before] for m in motions])
    filt = kalman(rig, motions, size, disturbance, doubt, _rms(angle))
    terms = 3 if rig.has_spring else 2
    names = list(rig.effects)
    spans: dict[str, list[int]] = {}
    for n in names:
        at = terms + 1 + sum(map(len, spans.values()))
        spans[n] = list(range(at, at + len(rig.effects[n])))
    columns = []
    for m, s in zip(motions, seen, strict=True):
        shape = [x for n in names for x in slopes(rig, m, n, rig.effects[n])]
        parts = [torque_along(rig, m, n, rig.effects[n]) for n in names]
        moved = [foreseen(rig, m, s), *motion_columns(m)[1:terms]]
        columns.append([*moved, np.ones(len(m.asked)), *shape, *parts])
    white = whitened(motions, seen, filt, columns)
    white, lacking = white[:, : white.shape[1] - len(names)], white[:, white.shape[1] - len(names) :]
    bound, oracle, whiteness = _bound(rig, motions, seen, filt, white, wrong)
    late = _lateness(rig, motions, seen, filt, np.delete(white, terms, axis=1))
    # Beside an encoder the gyro's own low-pass shows without any torque, also where the torque itself comes late.
    allowed = sorted(LATE) if late > LATE_ENERGY else ["sensor_lag"] if rig.sensors == "both" else []
    energy: dict[str, float] = {}
    beside: dict[str, Any] = {}
    for i, n in enumerate(names):
        taken = [*spans[n], terms] if n == "torque_offset" else spans[n]
        beside[n] = np.delete(white, taken, axis=1)
        energy[n] = float(np.sum(cleared(lacking[:, [i]], beside[n]) ** 2))
        if energy[n] < ENERGY:
            raise Unsuitable(f"{n} does not show")
    near = {n: _rivals(rig, motions, seen, filt, scale, n, lacking[:, [i]], beside[n]) for i, n in enumerate(names)}
    alike = _alike(energy, near, size, disturbance, outside)
    sticking = float(np.mean(np.concatenate([m.rate[m.before :] == 0.0 for m in motions])))
    unsound = f"stuck for {100.0 * sticking:.0f} % of the record" if sticking > MOST_STUCK else ""
    apart = max(abs(oracle[n]) / bound[n] for n in bound)
    if not unsound and apart > MOST_BOUNDS:  # steps of an encoder, say, that are far from white
        unsound = f"the oracle itself is {apart:.1f} of them off"
    return Evidence(energy, near, alike, allowed, bound, oracle, unsound, whiteness)


def _rms(x: Any) -> float:
    return float(np.sqrt(np.mean(x**2))) if len(x) else 0.0


def _bound(
    rig: Rig, motions: Sequence[Motion], seen: Sequence[Measured], filt: Filter, white: Any, wrong: Sequence[Any]
) -> tuple[dict[str, float], dict[str, float], float]:
    """Standard errors of J, C, K at best, errors of the oracle on this record, and the rms of its innovations."""
    terms = 3 if rig.has_spring else 2
    known = np.delete(white, terms, axis=1)  # the true model has no constant of its own
    known = known[:, np.sqrt(np.sum(known**2, axis=0)) > 0.0]
    norm = np.sqrt(np.sum(known**2, axis=0))
    cov = np.linalg.pinv((known / norm).T @ (known / norm), rcond=1e-12, hermitian=True) / np.outer(norm, norm)
    sigma = np.sqrt(np.diag(cov))[:terms]
    for value, limit, name in zip(sigma, MOST_ERROR_PERCENT, TERMS, strict=False):
        if not value < 0.01 * limit * getattr(rig, name):
            raise Unsuitable(f"{name} is not determined")
    rest = []
    for m, s, off in zip(motions, seen, wrong, strict=True):
        a, w, th = motion_columns(m)
        torque = off + rig.inertia * a + rig.damping * w + rig.stiffness * th - m.disturbance
        slope = {"rate_rad_s": np.gradient(m.rate, m.step_s), "angle_rad": m.rate}  # what a wrong stamp does
        readings = np.stack(
            [v - (s.late if k == "rate_rad_s" else 0.0) - m.sampled(slope[k]) * s.stamped_s for k, v in _ordered(s)],
            axis=1,
        )
        rest.append(filt(m, np.ascontiguousarray(readings[:, :, None]), s.arrived, [torque]))
    e = np.concatenate(rest)[:, 0]
    moved = cov @ (known.T @ e)
    used = np.concatenate([np.repeat(s.arrived, len(filt.r)) for s in seen])
    return (
        {n: float(x) for n, x in zip(TERMS, sigma, strict=False)},
        {n: float(x) for n, x in zip(TERMS, moved[:terms], strict=False)}, float(np.sqrt(np.mean(e[used] ** 2))),
    )  # fmt: skip


def _ordered(seen: Measured) -> list[tuple[str, Any]]:
    """The readings in the order of the filter's rows: rate, angle."""
    return [(k, seen.channels[k]) for k in ("rate_rad_s", "angle_rad") if k in seen.channels]


def _lateness(rig: Rig, motions: Sequence[Motion], seen: Sequence[Measured], filt: Filter, white: Any) -> float:
    """Chi-square that the low-pass of a gyro shows with, where no lag was hidden."""
    if rig.sensors == "encoder" or LATE & set(rig.effects):
        return 0.0
    rows = []
    for m, s in zip(motions, seen, strict=True):
        readings = np.zeros((len(m.at), len(filt.r), 1))
        readings[:, 0, 0] = s.late
        rows.append(filt(m, readings, s.arrived, [np.zeros(len(m.asked))]))
    return float(np.sum(cleared(np.concatenate(rows), white) ** 2))


def _rivals(
    rig: Rig, motions: Sequence[Motion], seen: Sequence[Measured], filt: Filter, scale: Scale, name: str, part: Any,
    others: Any,
) -> dict[str, float]:  # fmt: skip
    """Energy that each library effect leaves of an effect in its place, the closest five."""
    found: dict[str, float] = {}
    left_of = cleared(part, others)
    for rival in rivals.tried_on(rig, name, list(rig.effects)):
        for runs in rivals.columns(rig, motions, rival, scale):
            column = cleared(whitened(motions, seen, filt, runs), others)
            left = float(np.sum(cleared(left_of, column) ** 2))
            found[rival] = min(found.get(rival, np.inf), left)
    return dict(sorted(found.items(), key=lambda x: x[1])[:5])


def _alike(
    energy: dict[str, float], near: dict[str, dict[str, float]], size: Levels, disturbance: float, outside: bool
) -> dict[str, list[str]]:
    """Rivals that the record does not part, by effect; refuses what passes for another effect of another kind."""
    out: dict[str, list[str]] = {}
    for name, found in near.items():
        close = [r for r, left in found.items() if left < ENERGY]
        never = INSEPARABLE.get(name, frozenset())
        if name not in LIBRARY and close:
            raise Unsuitable(f"{name} passes for {', '.join(close)}")
        if any(r not in never and not {r, name} <= LATE for r in close):
            raise Unsuitable(f"{name} passes for {', '.join(close)}")
        out[name] = sorted(set(close) | never)
    return out
