"""How a torque is held between samples, and what a run may be used for."""

from __future__ import annotations

from typing import Literal

TorqueHold = Literal["band_limited", "zero_order"]
Use = Literal["auto", "fit", "holdout"]
