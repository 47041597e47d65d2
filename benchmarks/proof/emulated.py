"""The rig of the proofs on emulated devices in step: the drivers of a bench, real bytes, and no tick that is late.

The devices are those of examples/bench.yaml: a gyro with 2000 samples a second, its low-pass and its clock, and a drive
on CAN with its clock and steps of 0.12 N m.
"""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.proof.rigs import STEP_NM, TICK_S
from drivers.bench import BenchRig
from rig.config.bench import BenchConfig, EmulatorConfig, GyroscopeConfig
from rig.config.root import Config
from rig.errors import RigError
from rig.excitation import PlannedSet
from rig.guard import Guard
from rig.guard.motion import motion_checks
from rig.interface import Torque
from rig.platform import Platform
from rig.recording.run import Recording
from rig.sequencer import Sequencer
from sim_backend.emulators.launch import on_emulated_ports, started

BENCH = BenchConfig(
    gyroscope=GyroscopeConfig(sample_rate_hz=2000.0, settings={"datagram": 0x90, "filter_hz": 262}),
    emulator=EmulatorConfig(
        rated_torque_nm=STEP_NM * 1e3, peak_torque_nm=150.0, gyro_drift_ppm=20.0, clock="in_step"
    ),
    raw_capture=False,
)  # fmt: skip


def play(
    config: Config, sets: Sequence[PlannedSet], model: Platform, seed: int, rest_s: float | None
) -> tuple[Recording, RigError | None]:
    """The recording of sets on emulated devices, and what cut it short."""
    simulated = config.simulated.model_copy(update={"seed": seed})
    config = config.model_copy(update={"bench": BENCH, "simulated": simulated})
    with started(config) as emulators:
        section = on_emulated_ports(config, emulators).bench
        assert section is not None
        rig = BenchRig(section, Torque.EMULATED, clock=emulators.clock)
        guard = Guard(config.limits, motion_checks(config.limits, model))
        campaign = Sequencer(
            rig, rig.clock, guard, sample_rate_hz=1.0 / TICK_S,
            rest_s=config.excitation.rest_s if rest_s is None else rest_s, declared=model,
        ).play(sets)  # fmt: skip
    return campaign.recording, campaign.cause
