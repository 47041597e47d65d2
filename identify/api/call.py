"""``identify``: the whole identification as one call."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from identify.api.result import Result
from identify.api.runs import checked_recording, for_arrays, recording_of, with_uses
from identify.api.settings import Settings, settings_of
from identify.conclude.plausibility import with_declared
from identify.follow_up.planner import plan_follow_up, with_follow_up
from identify.follow_up.rounds import limits_of, sample_rate_hz
from identify.pipeline import identify as identified
from identify.results import Identification
from rig.errors import InputError, RecordingError
from rig.recording.run import Recording
from rig.signals import TorqueHold, Use

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from rig.config.model import ModelConfig
    from rig.platform import Platform


def identify(
    time_s: ArrayLike | Sequence[ArrayLike] | Recording,
    torque_nm: ArrayLike | Sequence[ArrayLike | None] | None = None,
    *,
    rate_rad_s: ArrayLike | Sequence[ArrayLike | None] | None = None,
    angle_rad: ArrayLike | Sequence[ArrayLike | None] | None = None,
    valid: ArrayLike | Sequence[ArrayLike | None] | None = None,
    declared: Mapping[str, Any] | str | Path | ModelConfig | Platform | None = None,
    axis: Literal["rotary", "linear"] | None = None,
    holdout: Literal["auto"] | float | Sequence[Use] | None = None,
    channels: Mapping[str, Mapping[str, Any]] | None = None,
    torque_hold: TorqueHold | None = None,
    noise: float | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Result:
    """Estimate inertia, damping and stiffness, name what the model is missing, and say what is left.

    The same as ``identify-run`` on a recorded campaign: the same numbers come out. It takes seconds to minutes. Ctrl-C
    returns what was found so far, marked ``aborted``. The first call of an installation also compiles.

    Parameters
    ----------
    time_s
        Time of the samples in s, strictly increasing: shape (n,), or a list with one array a run. Lost samples are
        left out, or marked by ``valid``. A ``Recording`` instead holds all arrays itself; then only the keywords from
        ``declared`` on may be given.
    torque_nm
        Torque on the shaft in N m (force in N on a linear axis) at ``time_s``: shape (n,), or a list. None for a free
        decay, from which only C/J and K/J are determined.
    rate_rad_s, angle_rad
        The measured channels in rad/s (m/s) and rad (m): shape (n,), or a list. At least one of the two.
    valid
        Shape (n,), or a list: False where a sample was lost. The values there may be NaN and are not used.
    declared
        The model as under ``model:`` in rig.yaml: a mapping (``{"inertia_kg_m2": 0.02, "terms": [...], "effects":
        {...}}``), the path of a model.yaml, or a ``Platform``. Without it, the default values of rig.yaml.
    axis
        "rotary" (the default) or "linear": labels and units only.
    holdout
        "auto", or the share of every run that is held out (0.05 to 0.5); or for every run "fit", "holdout" or "auto".
    channels
        Further measured channels that may act on the platform, as in rig.yaml with their readings: ``{"winding":
        {"kind": "temperature", "unit": "K", "values": array}}``, the array as ``time_s``. With a ``Recording``, which
        has the readings, without ``values``.
    torque_hold
        "band_limited" (the default): the torque is smooth between its samples. "zero_order": each was held until the
        next.
    noise
        One standard deviation of the rate (of the angle, where there is no rate); estimated where left out.
    settings
        Other keys of the section ``identify`` of rig.yaml, e.g. ``{"candidates": ["coulomb_friction"], "seed": 3}``.
    progress
        Is called with a line of text now and then, e.g. ``print``.

    Returns
    -------
    Result
        Prints as the summary, shows as a page in a notebook.

    Raises
    ------
    InputError
        For arguments that cannot be used, or data from which nothing can be identified; the message says which value
        and what to do. It is a ``ValueError``.
    """
    arrays = {"torque_nm": torque_nm, "rate_rad_s": rate_rad_s, "angle_rad": angle_rad, "valid": valid}
    if isinstance(time_s, Recording):
        its_own = {**arrays, "axis": axis, "torque_hold": torque_hold, "noise": noise}
        _refuse_beside_a_recording([name for name, value in its_own.items() if value is not None])
        asked = settings_of(declared, time_s.axis, holdout, channels, "band_limited", time_s.noise, settings)
        recording = with_uses(_with_known_channels(checked_recording(time_s), asked), asked.uses)
    else:
        given = ("rotary" if axis is None else axis), ("band_limited" if torque_hold is None else torque_hold)
        asked = settings_of(declared, given[0], holdout, channels, given[1], noise, settings)
        _require_readings(asked)
        section = asked.config.recorded
        assert section is not None  # it was built with one
        recording = recording_of(time_s, arrays, asked.readings, asked.uses, section.torque_hold, section.axis)
        recording = replace(recording, axis=section.axis, noise=section.noise)
    try:
        found = _found(recording, asked, progress)
    except RecordingError as error:
        raise InputError(for_arrays(str(error))) from None
    return Result(found, recording, asked.config.model)


def _found(recording: Recording, asked: Settings, progress: Callable[[str], None] | None) -> Identification:
    """As `identify-run` does it: identified, compared with what was declared, with a follow-up planned."""
    config = asked.config
    blind = replace(recording, info={})
    found = identified(blind, config.model.platform(), config.identify, progress)
    found = replace(with_declared(found, config.model.declared_numbers), recorded=True)
    if found.aborted:
        return found
    allowed = limits_of(found, config.limits, found.axis == "linear")
    try:
        planned = plan_follow_up(
            found, blind, allowed, sample_rate_hz(recording), config.excitation.rest_s, "follow-up"
        )
    except KeyboardInterrupt:  # what was identified is not given up for a plan
        return found
    return with_follow_up(found, planned)


def _refuse_beside_a_recording(names: Sequence[str]) -> None:
    if names:
        raise InputError(
            f"{names[0]} cannot be combined with a Recording, which already contains it: leave {names[0]}= out"
        )


def _require_readings(asked: Settings) -> None:
    for name in asked.config.identify.channels:
        if name not in asked.readings:
            raise InputError(
                f"channels[{name!r}] has no 'values': add its readings, one value for every time (an array, or a list "
                "with one array a run)"
            )


def _with_known_channels(recording: Recording, asked: Settings) -> Recording:
    """The recording itself, once it has every channel that was asked for."""
    for name in asked.readings:
        raise InputError(
            f"channels[{name!r}] has 'values' although the Recording already contains them: leave them out"
        )
    there = sorted({name for run in recording.runs for name in run.channels})
    for name in asked.config.identify.channels:
        if name not in there:
            has = ", ".join(map(repr, there)) if there else "none"
            raise InputError(f"channels[{name!r}] is not in the recording (it has {has}): correct the name")
    return recording
