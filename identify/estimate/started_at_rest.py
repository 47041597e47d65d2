"""Inertia that shows in rings alone: whether the runs began at rest decides what it is.

A platform with a spring rings from any start state that is not part of its steady motion, and a ring tells inertia
and stiffness apart. Shaken far below its resonance it shows its inertia in little else; a fitted start state then
makes a ring of the sensor's noise, the fit follows that into a false minimum, and the information matrix takes it for
a fact. A run that begins at rest has no such ring: held to that, what the fit says of the inertia comes from the
torque.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from identify.estimate.output_error import OutputErrorFit
from identify.model.parameters import Name
from identify.signals.torque_bandwidth import highest_torque_hz
from identify.simulate.shots import Shots, may_rest
from rig.dynamics import Equations

WEAK = 1e-3  # relative standard error of the inertia beyond which a ring of noise may decide it
NOISE_LIMITED_CHI_SQUARE = 2.0  # reduced chi-square up to which the noise, not the model, is in the way
BY_CHANCE = 15.0  # fall of chi square that two start values a run make of noise, their ring free to find its place
REST_ROUNDS = 3  # the place of rest moves with the model
SETTLED_CHI_SQUARE_FALL = 0.1  # of chi square, between rounds
QUASI_STATIC_RATIO = 0.1  # of the natural frequency: what shakes no faster hardly tells the inertia but by a ring
INERTIA: Name = ("inertia",)


class Refit(Protocol):
    """Fits one structure to the same samples of whole runs anew."""

    def __call__(
        self, values: Mapping[Name, float], *, rests: bool, held: Sequence[Name] = (),
        carry: Sequence[Shots] | None = None,
    ) -> OutputErrorFit:  # fmt: skip
        """From given values; ``rests`` holds runs to the rest they begin at, ``held`` parameters to their values.

        ``carry`` are the shots of an earlier fit, whose start states to begin with.
        """


def with_fixed_initial_state(free: OutputErrorFit, refit: Refit) -> OutputErrorFit:
    """A fit over whole runs, anew with the runs held to the rest they begin at, where that decides the inertia.

    Parameters
    ----------
    free
        The fit with its start states fitted.

    Returns
    -------
    ``free`` itself where the inertia does not hang on rings, where no run begins at rest, or where rest does not
    describe the runs: where they fit worse by more than the start states' share in the noise.
    """
    if not (depends_on_ringing(free) or (near(free) and is_quasi_static(free))):
        return free
    resting = sum(may_rest(s.trace, Equations(free.platform(s.number, s.added))) for s in free.shots)
    best, before = free, np.inf
    for _ in range(REST_ROUNDS if resting else 0):
        held = refit(best.values, rests=True)
        if not held.cost <= free.cost + BY_CHANCE * resting:
            break
        best = held
        if before - held.cost < SETTLED_CHI_SQUARE_FALL:
            break
        before = held.cost
    return best


def depends_on_ringing(fit: OutputErrorFit) -> bool:
    """Whether the inertia is known so little, beside the noise, that a ring of noise may decide it."""
    if INERTIA not in fit.names or not near(fit):
        return False
    return inertia_std_error(fit) > WEAK * abs(fit.values[INERTIA])


def near(fit: OutputErrorFit) -> bool:
    """Whether the noise, not the model, is in the way."""
    return fit.reduced_chi_square < NOISE_LIMITED_CHI_SQUARE


def is_quasi_static(fit: OutputErrorFit) -> bool:
    """Whether all torque is far below the natural frequency: a ring of noise looks like knowledge there.

    One that does not decay goes along with the noise of a whole run, at a frequency that tells the inertia to a
    thousandth of a percent.
    """
    inertia, stiffness = fit.values.get(INERTIA, 0.0), fit.values.get(("stiffness",), 0.0)
    if not (inertia > 0.0 and stiffness > 0.0) or not inertia_std_error(fit) > 0.0:
        return False
    natural_hz = float(np.sqrt(stiffness / inertia)) / (2.0 * np.pi)
    return all(highest_torque_hz(s.trace) < QUASI_STATIC_RATIO * natural_hz for s in fit.shots)


def inertia_std_error(fit: OutputErrorFit) -> float:
    """One standard error of the inertia for a white residual; zero where it was held still."""
    at = fit.names.index(INERTIA)
    size = np.sqrt(np.maximum(np.diag(fit.information), 0.0))
    shown = size > 0.0
    if not shown[at]:
        return 0.0
    scaled = fit.information[np.ix_(shown, shown)] / np.outer(size[shown], size[shown])
    inverse = np.linalg.pinv(scaled, hermitian=True)
    i = int(np.sum(shown[:at]))
    return float(np.sqrt(max(inverse[i, i], 0.0))) * fit.sigma / float(size[at])
