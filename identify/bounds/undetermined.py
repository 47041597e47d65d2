"""What the data do not determine, and why, in words for the person who can run another set."""

from __future__ import annotations

from collections.abc import Set

import numpy as np

from identify.estimate.final_fit import FinalFit
from identify.model.parameters import Name
from identify.wording import number

TIED = 0.95  # correlation beyond which two parameters are one
OPEN_RAD = 0.5  # standard error of a phase beyond which it is open
UNDETERMINED_RELATIVE_ERROR = 0.5  # of its value: a standard error that says nothing of a term
BETWEEN_MODELS = (
    "models that these data do not tell apart differ in it by more than half of its value; "
    "add a set at another frequency"
)


def undetermined(fitted: FinalFit, runs: Set[int], alone: bool) -> dict[Name, str]:
    """Parameters of a fit that its data do not determine, and why; in the order of the fit.

    ``runs`` are the numbers of those that the fit looked at, ``alone`` says that there is no other run.
    """
    out: dict[Name, str] = {}
    for i, name in enumerate(fitted.names):
        if of_another_run(name, runs):
            continue
        value, error, term = fitted.values[name], fitted.reported_error(name), len(name) == 1
        tied = _undetermined_partner(fitted, i, alone) if term else ""
        wide = term and (not np.isfinite(error) or error > UNDETERMINED_RELATIVE_ERROR * abs(value))
        if tied:
            out[name] = f"only its combination with {tied} is determined; add a set at another frequency"
        elif not fitted.determined[i] or wide:
            known = np.isfinite(error) and fitted.std_error(name) <= UNDETERMINED_RELATIVE_ERROR * abs(value)
            out[name] = BETWEEN_MODELS if known and wide else _why(value, error, fitted.determined[i])
    return out


def open_phases(fitted: FinalFit) -> dict[Name, float]:
    """Standard errors of sine and cosine gains whose phase the data do not tell: their amplitude at least.

    Beside a phase that may be anything the errors of a fit hold at the one phase where it stopped.
    """
    out: dict[Name, float] = {}
    for effect in fitted.structure.effects:
        pair: tuple[Name, Name] = (effect, "sine"), (effect, "cosine")
        if not all(name in fitted.names for name in pair):
            continue
        at = np.array([fitted.names.index(name) for name in pair])
        sine, cosine = fitted.values[pair[0]], fitted.values[pair[1]]
        amplitude = float(np.hypot(sine, cosine))
        along = np.array([-cosine, sine]) / max(amplitude, 1e-300)
        spread = float(np.sqrt(max(along @ fitted.covariance[np.ix_(at, at)] @ along, 0.0)))
        if not spread < OPEN_RAD * amplitude:
            out |= {name: max(fitted.std_error(name), amplitude) for name in pair}
    return out


def of_another_run(name: Name, runs: Set[int]) -> bool:
    """Whether a parameter belongs to a run that no fit looked at: it came with the start state, to judge that run."""
    return len(name) == 3 and int(name[2]) not in runs


def _why(value: float, error: float, determined: bool) -> str:
    if not determined:
        return "these runs hold no information on it; add a set at another frequency or keep the start transient"
    return (
        f"its standard error {number(error, 2)} is more than half of its value {number(value, 2)}; use more torque or "
        "a longer record"
    )


def _undetermined_partner(fitted: FinalFit, i: int, alone: bool) -> str:
    """A term that the data do not determine and that drags this one along; empty where there is none.

    In a single run (``alone``) inertia and stiffness are one number at each frequency.
    """
    size = np.sqrt(np.maximum(np.diag(fitted.covariance), 1e-300))
    for k, name in enumerate(fitted.names):
        if k == i or len(name) > 1:
            continue
        lost = not fitted.determined[k] or not size[k] <= UNDETERMINED_RELATIVE_ERROR * abs(fitted.values[name])
        pair = alone and {name[0], fitted.names[i][0]} == {"inertia", "stiffness"}
        one = abs(fitted.covariance[i, k]) > TIED * size[i] * size[k]
        if lost and fitted.determined[i] and (pair or one):
            return name[0]
    return ""
