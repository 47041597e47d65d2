"""The bench: a gyroscope on a serial port and an amplifier on CAN as one rig."""

from drivers.bench.rig import BenchReport, BenchRig

__all__ = ["BenchReport", "BenchRig"]
