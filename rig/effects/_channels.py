"""Effects whose cause is a further measured channel: made at run time, one for each way in which a channel may act.

A kernel sees its channel in ``p``: behind the effect's own parameters stand the address of a table of
factor * (x - reference), the number of its entries a second, and how many there are. The table begins with the
run, so the kernel reads it at its own ``time``; integrator and all other kernels know nothing of it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.channels import Channel
from rig.effects.base import Effect, Parameter, Place
from rig.errors import ConfigError

SLOTS = 4  # behind an effect's own parameters: where the table is, entries a second, entries, time of the first in s
AT_REST: Any = np.zeros(2)  # the table of a channel that nobody measures: it stands at its reference


@dataclass(frozen=True)
class _Way:
    """One way in which a channel may act: T = slope * (x - x0) * what its unit says."""

    kernel: str  # its name in ``_channel_kernels``
    place: Place
    equation: str
    meaning: str
    sign: str
    unit: str  # of the slope times a reading
    suffix: str
    separated_by: str
    family: str
    lower_order: tuple[str, ...] = ()


_ALONE = "from other effects: record a run in which {x} changes by itself"
_WAYS = {
    "torque": _Way(
        "torque_of", Place.LOAD, "T = slope * (x - x0)", "A torque proportional to {x}: coupling, tilt, a cable.",
        "Resisting: positive with {x} above x0.", "N*m", "nm", _ALONE, "coupling",
    ),
    "stiffness": _Way(
        "stiffness_of", Place.LOAD, "T = slope * (x - x0) * th", "The stiffness changes with {x}.",
        "K is the stiffness at x0; a positive slope stiffens.", "N*m/rad", "nm_rad", _ALONE, "restoring torque",
    ),
    "damping": _Way(
        "damping_of", Place.LOAD, "T = slope * (x - x0) * w", "The damping changes with {x}.",
        "C is the damping at x0; a positive slope damps.", "N*m*s/rad", "nm_s_rad", _ALONE, "friction",
    ),
    "gain": _Way(
        "gain_of", Place.LOAD, "M = [1 + slope * (x - x0)] * torque",
        "The torque per ampere changes with {x}: magnets weaken as they warm.",
        "The recorded torque is right at x0; with a negative slope the shaft gets less above x0.", "1", "1", _ALONE,
        "drive",
    ),
    "friction": _Way(
        "torque_of", Place.FRICTION, "T = slope * (x - x0) * sgn(w)", "Dry friction changes with {x}.",
        "coulomb_friction is the level at x0; a negative slope lowers it above x0.", "N*m", "nm", _ALONE, "friction",
        ("coulomb_friction",),
    ),
    "drive": _Way(
        "drive_of", Place.LOAD, "M = torque + share * (factor * x - torque)",
        "The torque on the shaft is that of {x}, not the recorded one, where the two differ.",
        "1: the shaft follows {x} alone; 0: it follows the recorded torque.", "1", "",
        "from a lag or limit of the drive: play torques at which {x} differs from the recorded torque in another way",
        "drive",
    ),
}  # fmt: skip
_MADE: dict[str, Effect] = {}


def effect_name(channel: str, way: str) -> str:
    """What an effect of a channel is called."""
    return f"{channel}_{way}"


def names() -> tuple[str, ...]:
    """Effects of all channels declared so far."""
    return tuple(_MADE)


def get(name: str) -> Effect:
    """The effect of that name. Raises KeyError where no declared channel has it."""
    return _MADE[name]


def declare(channels: Iterable[Channel], is_taken: Callable[[str], bool]) -> None:
    """Make the effects of channels known, in the place of those of channels of the same name.

    Raises
    ------
    ConfigError
        Where an effect of a channel would bear the name of another effect.
    """
    for channel in channels:
        made = {effect_name(channel.name, way): make(channel, way) for way in channel.nature.ways}
        taken = [name for name in made if is_taken(name)]
        if taken:
            raise ConfigError(
                f"a channel {channel.name!r} would make an effect {taken[0]!r}, and there is one: rename it"
            )
        for name in [n for n, e in _MADE.items() if e.reads is not None and e.reads.name == channel.name]:
            del _MADE[name]
        _MADE.update(made)


def make(channel: Channel, way: str) -> Effect:
    """The effect that a channel has in one way."""
    from rig.effects import _channel_kernels  # noqa: PLC0415  compiled kernels: only where there is a channel

    form, words = _WAYS[way], channel.name.replace("_", " ")
    if way == "drive":
        parameter = Parameter("share", "1", "share of the torque that follows the channel", linear=True)
    else:
        unit, suffix = _per(form.unit, form.suffix, channel.measured_in)
        parameter = Parameter(
            "slope", unit, f"change per {channel.measured_in} of {words}", linear=True, low=-float("inf"), suffix=suffix
        )
    return Effect(
        name=effect_name(channel.name, way), family=form.family, place=form.place, equation=form.equation,
        source="first-order dependence on a measured channel", meaning=form.meaning.format(x=words),
        sign=form.sign.format(x=words), parameters=(parameter,),
        kernel=getattr(_channel_kernels, form.kernel), lower_order=form.lower_order,
        separated_by=form.separated_by.format(x=words), reads=channel,
    )  # fmt: skip


def _per(unit: str, suffix: str, measured_in: str) -> tuple[str, str]:
    """Unit of a slope, and the suffix of its key: N*m per rad/s^2 as "N*m/(rad/s^2)" and nm_per_rad_s2."""
    below = f"({measured_in})" if re.search(r"[*/ ]", measured_in) else measured_in
    if measured_in == "1":
        return unit, suffix
    word = "_".join(re.findall(r"[a-z0-9]+", measured_in.lower().replace("^", "")))
    return f"{unit}/{below}", f"{suffix}_per_{word}" if word else suffix
