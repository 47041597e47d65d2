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
    """Import every effect, play the simulated rig with its motor, and make the torque of a blind case."""
    from benchmarks.blind import excitations as blind  # noqa: PLC0415
    from rig import effects  # noqa: PLC0415
    from rig.excitation import Sine  # noqa: PLC0415
    from tests.sim_backend.test_simulated import DRIVES, config, played  # noqa: PLC0415

    for name in effects.names():
        effects.get(name)
    effects.free_forms()
    blind.multisine(60.0, (2.0, 7.0), 0.1)
    played(config(DRIVES[-1]), Sine(torque_nm=6.0, frequency_hz=9.0, duration_s=0.2))


if __name__ == "__main__":
    plants() if PLANTS in sys.argv else main()
