"""The `simulated` section: the rig that stands in for the real one, and the truth it hides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from rig.config.base import NonNegative, Positive, Section
from rig.config.model import ModelConfig

NEVER_NEGATIVE = ("damping_nm_s_rad", "stiffness_nm_rad")  # of a simulated platform, which would be unstable
FASTEST_HZ = 5000.0  # of a simulated platform: each turn of it takes some two hundred fine steps


class SimulatedGyro(Section):
    """A gyroscope by its data sheet; the default noise is the accuracy of the paper's.

    ``delay_s`` is the transport delay from the instant of a sample until its time stamp is taken;
    together with the group delay of ``bandwidth_hz`` it is subtracted from the time stamps unless
    ``corrected_delay_s`` says how much of it the driver knows.
    """

    sample_rate_hz: Annotated[float, Field(ge=10, le=20_000)] = 1000.0
    """Sample rate, Hz."""
    noise_deg_s: NonNegative = 0.05
    """White noise, one standard deviation of a sample, deg/s."""
    bias_deg_s: float = 0.0
    """Constant error of the rate, deg/s."""
    resolution_deg_s: Positive | None = None
    """Step of the rate, deg/s; continuous if left out."""
    full_scale_deg_s: Positive | None = 400.0
    """Rate at which the samples clip, deg/s; null: never."""
    bandwidth_hz: Annotated[float, Field(gt=0, le=2000)] | None = None
    """Bandwidth of the sensor, Hz; unlimited if left out."""
    delay_s: Annotated[float, Field(ge=0, le=0.1)] = 0.0
    """Transport delay from the instant of a sample to its time stamp, s."""
    corrected_delay_s: Annotated[float, Field(ge=0, le=0.1)] | None = None
    """Part of delay and group delay that the driver subtracts, s; all if left out."""


class IdealAmplifier(Section):
    """The torque asked for, exactly, at every instant between the ticks too."""

    kind: Literal["ideal"] = "ideal"
    """ideal: exactly the torque asked for; hold: steps; motor: a torque motor."""


class HoldAmplifier(Section):
    """A torque drive: each command is rounded to the resolution and held until the next."""

    kind: Literal["hold"]
    """ideal: exactly the torque asked for; hold: steps; motor: a torque motor."""
    resolution_nm: Positive | None = None
    """Step of the torque, N m; continuous if left out."""


class MotorAmplifier(Section):
    """DC torque motor behind an amplifier, direct or geared (Eq. 6, Fig. 2, 3).

    ``control: current`` closes a current loop of ``bandwidth_hz`` that hides back-EMF until
    ``voltage_limit_v`` is reached; ``control: voltage`` applies the voltage that would hold the asked
    torque at standstill, so back-EMF and inductance act fully. All torques are those at the shaft.
    ``rotor_inertia_kg_m2`` times the square of the gear ratio adds to the platform's inertia.
    """

    kind: Literal["motor"]
    """ideal: exactly the torque asked for; hold: steps; motor: a torque motor."""
    control: Literal["current", "voltage"] = "current"
    """current: a closed current loop; voltage: back-EMF and inductance act fully."""
    bandwidth_hz: Annotated[float, Field(gt=0, le=50_000)] = 1000.0
    """Bandwidth of the current loop, Hz."""
    resistance_ohm: Positive = 1.0
    """Resistance of the winding, ohm."""
    inductance_h: Positive = 2e-3
    """Inductance of the winding, H."""
    torque_constant_nm_a: Positive = 6.0
    """Shaft torque per current, N m/A."""
    voltage_limit_v: Positive = 300.0
    """Largest voltage, V."""
    gear_ratio: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    """Shaft torque over motor torque."""
    gear_efficiency: Annotated[float, Field(gt=0, le=1)] = 1.0
    """Efficiency of the gear, 0 to 1."""
    rotor_inertia_kg_m2: NonNegative = 0.0
    """Inertia of the rotor, kg m^2."""
    resolution_nm: Positive | None = None
    """Step of the torque, N m; continuous if left out."""


def _kind(value: Any) -> Any:
    return value.get("kind", "ideal") if isinstance(value, Mapping) else getattr(value, "kind", None)


AnyAmplifier = Annotated[
    Annotated[IdealAmplifier, Tag("ideal")]
    | Annotated[HoldAmplifier, Tag("hold")]
    | Annotated[MotorAmplifier, Tag("motor")],
    Discriminator(_kind),
]


class SimulatedConfig(Section):
    """The simulated rig. ``platform`` is the truth: the identifier never sees it."""

    platform: ModelConfig = ModelConfig()
    """The truth, which the identifier never sees; or the path of a model.yaml."""
    gyro: SimulatedGyro = SimulatedGyro()
    """The simulated gyroscope."""
    amplifier: AnyAmplifier = IdealAmplifier()
    """The simulated amplifier."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    """Seed of the noise."""

    @model_validator(mode="after")
    def _is_stable(self) -> Self:
        for key in NEVER_NEGATIVE:
            if getattr(self.platform, key) < 0:
                raise ValueError(f"platform.{key} is negative: such a platform is unstable; give 0 or more")
        inertia = self.platform.inertia_kg_m2
        resonance_hz = math.sqrt(self.platform.stiffness_nm_rad / inertia) / (2 * math.pi)
        decay_hz = self.platform.damping_nm_s_rad / inertia / (2 * math.pi)
        if max(resonance_hz, decay_hz) > FASTEST_HZ:
            raise ValueError(
                f"platform moves at up to {max(resonance_hz, decay_hz):.3g} Hz (stiffness {resonance_hz:.3g} Hz, "
                f"damping {decay_hz:.3g} Hz), which takes too long to simulate: at most {FASTEST_HZ:g} Hz, so raise "
                "inertia_kg_m2 or lower stiffness_nm_rad or damping_nm_s_rad"
            )
        return self
