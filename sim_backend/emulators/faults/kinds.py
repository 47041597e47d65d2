"""The table of faults by name."""

from __future__ import annotations

from sim_backend.emulators.faults import drive, gyro
from sim_backend.emulators.faults.base import Fault

FAULTS: dict[str, type[Fault]] = {
    "gyro_unplugged": gyro.GyroUnplugged,
    "gyro_replugged": gyro.GyroReplugged,
    "gyro_silent": gyro.GyroSilent,
    "gyro_checksum": gyro.GyroChecksum,
    "gyro_dropped": gyro.GyroDropped,
    "gyro_repeated": gyro.GyroRepeated,
    "gyro_delayed": gyro.GyroDelayed,
    "gyro_merged": gyro.GyroMerged,
    "gyro_garbled": gyro.GyroGarbled,
    "gyro_flagged": gyro.GyroFlagged,
    "gyro_restarts": gyro.GyroRestarts,
    "gyro_stuck": gyro.GyroStuck,
    "gyro_reversed": gyro.GyroReversed,
    "gyro_loose": gyro.GyroLoose,
    "gyro_jump": gyro.GyroJump,
    "gyro_noisy": gyro.GyroNoisy,
    "gyro_spikes": gyro.GyroSpikes,
    "gyro_drifts": gyro.GyroDrifts,
    "gyro_scaled": gyro.GyroScaled,
    "gyro_saturated": gyro.GyroSaturated,
    "adapter_unplugged": drive.AdapterUnplugged,
    "adapter_replugged": drive.AdapterReplugged,
    "both_unplugged": drive.BothUnplugged,
    "adapter_stalls": drive.AdapterStalls,
    "adapter_garbled": drive.AdapterGarbled,
    "adapter_slow": drive.AdapterSlow,
    "adapter_drops": drive.AdapterDrops,
    "bus_off": drive.BusOff,
    "bus_deaf": drive.BusDeaf,
    "host_beat_lost": drive.HostBeatLost,
    "drive_beat_lost": drive.DriveBeatLost,
    "drive_fault": drive.DriveFault,
    "drive_emergency": drive.DriveEmergency,
    "drive_reset": drive.DriveReset,
    "drive_stopped": drive.DriveStopped,
    "drive_pre_operational": drive.DrivePreOperational,
    "drive_off": drive.DriveOff,
    "torque_runs_away": drive.TorqueRunsAway,
    "torque_reversed": drive.TorqueReversed,
    "torque_saturates": drive.TorqueSaturates,
    "torque_dead": drive.TorqueDead,
    "torque_doubled": drive.TorqueDoubled,
    "torque_stuck": drive.TorqueStuck,
}
"""By the name under which they are asked for."""
