"""Compiles what most tests run: `python -m tests.compile_ahead`. Three workers would each compile it for themselves."""

from __future__ import annotations

import subprocess
import sys

PLANTS = "plants"


def main() -> None:
    """Compile the identification here, effects and simulated rigs in a process beside this one."""
    beside = subprocess.Popen([sys.executable, "-m", "tests.compile_ahead", PLANTS])
    identification()
    if beside.wait():
        raise SystemExit(beside.returncode)


def identification() -> None:
    """Simulate and identify a small campaign."""
    from identify.pipeline import identify  # noqa: PLC0415  the other process needs none of this
    from rig.config.identify import IdentifyConfig  # noqa: PLC0415
    from rig.platform import Platform  # noqa: PLC0415
    from tests.identify.simulated import SETS, TRUTH, campaign  # noqa: PLC0415

    hidden = {"coulomb_friction": {"level": 1.0}, "torque_delay": {"delay": 6e-4}}
    runs = campaign(hidden, sets=SETS[2:4], duration_s=1.0)
    identify(runs, Platform(*TRUTH), IdentifyConfig.model_validate({"candidates": list(hidden)}))


def plants() -> None:
    """Make gains, import every effect, play the simulated rig with its motor, and make the torque of a blind case."""
    import numpy as np  # noqa: PLC0415

    from benchmarks.blind import excitations as blind  # noqa: PLC0415
    from rig import effects  # noqa: PLC0415
    from rig.dynamics.gains import Noise, Sensing, gains_of  # noqa: PLC0415
    from rig.dynamics.linear_part import LinearPart  # noqa: PLC0415
    from rig.excitation import Sine  # noqa: PLC0415
    from tests.sim_backend.test_simulated import DRIVES, config, played  # noqa: PLC0415

    # First, while the other process compiles the simulation: it needs these next.
    gains_of(LinearPart(0.02, 0.05, 700.0), Noise(1e-3, 0.1), 1e-3, Sensing(True), np.ones(9, bool), [(0, 8)])
    for name in effects.names():
        effects.get(name)
    effects.free_forms()
    blind.multisine(60.0, (2.0, 7.0), 0.1)
    played(config(DRIVES[-1]), Sine(torque_nm=6.0, frequency_hz=9.0, duration_s=0.2))


if __name__ == "__main__":
    plants() if PLANTS in sys.argv else main()
