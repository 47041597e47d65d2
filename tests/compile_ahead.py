"""Compiles what most tests run: `python -m tests.compile_ahead`. Three workers would each compile it for themselves."""

from __future__ import annotations

from identify.pipeline import identify
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from tests.identify.simulated import SETS, TRUTH, campaign


def main() -> None:
    """Simulate and identify a small campaign."""
    hidden = {"coulomb_friction": {"level": 1.0}, "torque_delay": {"delay": 6e-4}}
    runs = campaign(hidden, sets=SETS[2:4], duration_s=1.0)
    identify(runs, Platform(*TRUTH), IdentifyConfig.model_validate({"candidates": list(hidden)}))


if __name__ == "__main__":
    main()
