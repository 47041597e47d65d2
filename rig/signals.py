"""How a torque is held between samples, what a run may be used for, and how a file is said to lack a column."""

from __future__ import annotations

from typing import Literal

TorqueHold = Literal["band_limited", "zero_order"]
Use = Literal["auto", "fit", "holdout"]
NO_COLUMN = "none"  # in the place of a column's name: the quantity is not read, whatever the file has
