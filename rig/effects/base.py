"""What an effect is: one object that simulator, identifier, report and docs all read.

An effect acts at one of four places between recorded torque and measured rate:

    torque_nm -> DRIVE filters -> J a + C w + K th + LOAD torques + FRICTION sgn(w) = M -> SENSOR filters -> rate

Kernels are compiled functions (see ``kernel`` and ``filter_kernel``). The parameter vector ``p`` that a
LOAD or FRICTION kernel receives starts with the platform's own J, C, K, followed by the effect's
parameters in their declared order, so that an effect may lean on the spring it modifies (backlash).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numba
from numba import types

from rig.arrays import Array
from rig.channels import Channel

KERNEL_SIGNATURE = types.float64(
    types.float64,  # angle_rad
    types.float64,  # rate_rad_s (FRICTION kernels receive its magnitude)
    types.float64,  # time_s since the start of the run
    types.float64,  # torque_nm on the shaft, after the drive
    types.CPointer(types.float64),  # state of this effect
    types.CPointer(types.float64),  # its time derivative, written by the kernel
    types.CPointer(types.float64),  # p: J, C, K, then the effect's own parameters
)
FILTER_SIGNATURE = types.float64(
    types.float64,  # x, the sample that enters
    types.float64,  # step_s between samples
    types.CPointer(types.float64),  # state of this filter, updated in place
    types.CPointer(types.float64),  # the effect's own parameters
)

kernel = numba.cfunc(KERNEL_SIGNATURE, cache=True, error_model="numpy")
filter_kernel = numba.cfunc(FILTER_SIGNATURE, cache=True, error_model="numpy")


class Place(Enum):
    """Where an effect acts."""

    DRIVE = "drive"  # a causal filter on the torque
    LOAD = "load"  # a resisting torque, with internal states if it has memory
    FRICTION = "friction"  # a level of dry friction: sign, sticking and breakaway are the integrator's
    SENSOR = "sensor"  # a causal filter on the rate


@dataclass(frozen=True)
class Scale:
    """How large the motion is: from it an effect chooses starting values of its shape parameters."""

    angle_rad: float
    rate_rad_s: float
    torque_nm: float
    duration_s: float
    step_s: float
    natural_frequency_hz: float
    excitation_hz: tuple[float, ...] = ()
    lines_hz: tuple[float, ...] = ()  # spectral lines of the current residual
    orders: tuple[float, ...] = ()  # lines of the current residual against the angle, periods a turn
    rings_hz: tuple[float, ...] = ()  # frequencies that decay in the residual after the start of runs
    modes_hz: tuple[float, ...] = ()  # of second masses on the shaft that carry most of the torque nobody recorded
    ringing_hz: float = 0.0  # strongest spectral line of the measured motion next to the natural frequency


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    ``linear`` parameters enter the torque as a factor and are solved for; the others are shape
    parameters and are searched between ``low`` and ``high``, starting from ``start(scale)``.
    """

    name: str
    unit: str  # as result.json prints it, e.g. "N*m"
    meaning: str
    linear: bool = False
    low: float = 0.0
    high: float = float("inf")
    suffix: str = ""  # unit suffix of the rig.yaml key, e.g. "nm"
    start: Callable[[Scale], tuple[float, ...]] | None = None
    per_run: bool = False  # takes a value of its own in every run (the phase of a disturbance)
    neutral: float = 0.0  # value at which the effect vanishes
    searched: bool = True  # False: a shape that the size of the motion gives, which no fit moves

    @property
    def key(self) -> str:
        """Name with its unit, as written in rig.yaml and model.yaml."""
        return f"{self.name}_{self.suffix}" if self.suffix else self.name


class LargeStart(NamedTuple):
    """Starting values for the fit of an effect: terms of the platform, and own parameters."""

    terms: Mapping[str, float]
    own: Mapping[str, float]


class Alike(NamedTuple):
    """Why no data of torque and rate can tell two effects apart, up to which travel to either side, and the cure."""

    because: str
    travel_deg: float = math.inf
    cure: str = ""

    @property
    def why(self) -> str:
        """One clause for report and docs: within which travel, why, and what separates them."""
        within = f"within {self.travel_deg:g} deg " if math.isfinite(self.travel_deg) else ""
        return f"{within}{self.because}" + (f"; {self.cure}" if self.cure else "")


@dataclass(frozen=True)
class Effect:
    """A physical effect, described once.

    ``states`` is the number of internal states of a LOAD kernel; a filter's number of states may depend
    on the step and its parameters and is given by ``filter_states(step_s, values)``.
    """

    name: str
    family: str
    place: Place
    equation: str
    source: str
    meaning: str
    sign: str
    parameters: tuple[Parameter, ...]
    kernel: Any
    states: int = 0
    has_linear_states: bool = False  # a LOAD whose torque and states are linear in angle, rate and states
    filter_states: Callable[[float, tuple[float, ...]], int] | None = None
    rest_state: Callable[[float, float], tuple[float, ...]] | None = None  # of angle and rate at the start
    lag: Callable[[tuple[float, ...]], tuple[float, float]] | None = None  # of a SENSOR: s and s^2 of its denominator
    delay_s: Callable[[tuple[float, ...]], float] | None = None  # of a DRIVE: by how much it delays a slow torque
    fastest_rad_s: Callable[[tuple[float, ...]], float] | None = None  # of (J, C, K, *values): sets the step
    # Of the same: the angle over which its states follow the motion, if they follow the angle and not time.
    follows_within_rad: Callable[[tuple[float, ...]], float] | None = None
    kinks: Callable[[tuple[float, ...]], tuple[float, ...]] | None = None  # angles at which its torque bends
    bends_torque: bool = False  # a drive effect that makes a smooth torque non-smooth (corners)
    spreads: bool = False  # a drive effect with more memory than a delay: ahead of a bend it is another than behind it
    is_first_order_lag: bool = False  # of one time: a low-pass as a platform without a spring is one
    may_push: bool = False  # can push away from rest itself: what is left to the stiffness is a spring
    leans_on: tuple[str, ...] = ()  # terms of the platform on which its torque depends (backlash: the stiffness)
    ordered: tuple[tuple[str, str], ...] = ()  # pairs of parameters of which the first is the smaller
    lower_order: tuple[str, ...] = ()  # effects that have to be in the model first: a constant before a slope
    nests: tuple[str, ...] = ()  # simpler effects that this one contains as a special case
    # By special case, from its values: own values by name with which this one does the same, whatever the others are.
    from_special: Mapping[str, Callable[[tuple[float, ...]], Mapping[str, float]]] | None = None
    never_separable: Mapping[str, Alike] | None = None  # rival -> why no data of torque and rate can tell them apart
    # By rival of never_separable, from its own values: the values of that rival, and what the change adds to J, C, K.
    as_rival: Mapping[str, Callable[[tuple[float, ...]], LargeStart]] | None = None
    relaxes: str = ""  # its parameter that is a time constant: a run has to show it relax
    repeats: str = ""  # its parameter that is a frequency in time: a run has to show a period of it
    repeats_over_angle: str = ""  # one that is a frequency over the angle: more of it only if it is seen to repeat
    needs_added_inertia: bool = False  # determined only if some runs have a known inertia mounted
    # From (J, C, K) and the scale: starting values of the platform and of the effect if the effect is large.
    large_starts: Callable[[tuple[float, float, float], Scale], tuple[LargeStart, ...]] | None = None
    # From fitted (J, C, K), fitted own values and the scale: starting values near other possible minima.
    other_minima: Callable[[tuple[float, float, float], tuple[float, ...], Scale], tuple[LargeStart, ...]] | None = None
    is_flexible: bool = False  # flexible enough to fit the residual that another missing effect leaves
    # Of a flexible one: quantities that a residual may depend on beside it, since more of its own kind would.
    goes_with: tuple[str, ...] = ()
    sought_alone: bool = False  # never proposed in a pair: with some shape it fits what any other effect leaves
    separated_by: str = ""  # "from RIVAL: experiment, as an imperative; from ..."
    reads: Channel | None = None  # the measured channel that it is an effect of
    # Of a DRIVE effect: torque wanted behind it, (n,) at even steps of so many s, and its values -> torque to ask for.
    inverse: Callable[[Array, float, tuple[float, ...]], Array] | None = None
    ahead_s: Callable[[tuple[float, ...]], float] | None = None  # by how much earlier the inverse asks for a torque
    # Its torque (of dry friction its level) in the syntax that C and Python share, of angle_rad, rate_rad_s, torque_nm,
    # stiffness_nm_rad and its own parameters by their key; empty where it has memory.
    formula: str = ""
    foreseen: bool = True  # False: nobody knows before a run what it will do in it (its phase, say)
    # Of (J, C, K, *values): the platform may rest this far to either side of where its spring would hold it.
    rests_within_rad: Callable[[tuple[float, ...]], float] | None = None
    stays: str = ""  # what of it no torque that is computed before a run takes away, and why: one clause

    @property
    def cancelled_by_torque(self) -> bool:
        """Whether a torque that is computed before a run can take its part in the motion away, if not all of it."""
        in_motion = self.place in (Place.LOAD, Place.FRICTION) or self.inverse is not None
        return in_motion and self.foreseen and self.reads is None

    @property
    def is_steady(self) -> bool:
        """Whether its torque on the shaft, or its level of dry friction, depends on nothing."""
        varies = any(x in self.formula for x in ("angle_rad", "rate_rad_s", "torque_nm"))
        return self.place in (Place.LOAD, Place.FRICTION) and bool(self.formula) and not varies and not self.states

    @property
    def is_constant(self) -> bool:
        """Whether it is a torque that depends on nothing."""
        return self.place is Place.LOAD and self.is_steady

    def late_s(self, values: tuple[float, ...]) -> float:
        """By how much later slow motion is read because of it, wherever between torque and reading it acts."""
        if self.lag is not None:  # a low-pass delays by the first coefficient of its denominator
            return self.lag(values)[0]
        return self.delay_s(values) if self.delay_s is not None else 0.0

    @property
    def is_late(self) -> bool:
        """Whether it is a lag or a delay, wherever between torque and reading it acts."""
        return self.lag is not None or self.delay_s is not None

    def per_inertia(self, parameter: Parameter) -> bool:
        """Whether a free decay determines only the ratio of a parameter to the inertia, as of every torque."""
        return self.place in (Place.LOAD, Place.FRICTION) and parameter.unit.startswith(("N", "kg"))

    def alike(self, rival: str, travel_deg: float) -> str:
        """Why no data within a travel can tell it from a rival; empty if data can."""
        found = (self.never_separable or {}).get(rival)
        return found.why if found is not None and travel_deg <= found.travel_deg else ""

    def values(self, given: Mapping[str, float]) -> tuple[float, ...]:
        """Parameter values in declared order from a mapping of name (or key) to value.

        Raises
        ------
        KeyError
            With the missing or unknown names.
        """
        by_name = {p.key: p.name for p in self.parameters} | {p.name: p.name for p in self.parameters}
        unknown = [k for k in given if k not in by_name]
        resolved = {by_name[k]: float(v) for k, v in given.items() if k in by_name}
        missing = [p.key for p in self.parameters if p.name not in resolved]
        if unknown or missing:
            raise KeyError(f"{self.name}: unknown {unknown}, missing {missing}")
        return tuple(resolved[p.name] for p in self.parameters)
