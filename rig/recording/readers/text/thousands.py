"""Signs between thousands, which a number with three decimals is not told from by itself."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from rig.arrays import Array

_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}$")
_SMALL = re.compile(r"[-+]?\d{1,3}$")  # a whole number below a thousand, which needs no sign


def may_be_grouped(values: Array) -> bool:
    """Whether a column, shape (n,), could hold thousands that were read as numbers with three decimals.

    Its numbers are whole and below a thousand, or have no more than three decimals and are 1 at least; some are of
    either kind, and of the whole ones some have three digits. Decimals as instruments write them are also below one.
    """
    size = np.abs(values[np.isfinite(values)])
    whole = size == np.rint(size)
    if not size.size or whole.all() or size.max() >= 1000.0 or not np.any(whole & (size >= 100.0)):
        return False
    rest = size[~whole]
    return bool(rest.min() >= 1.0 and np.allclose(1e3 * rest, np.rint(1e3 * rest), rtol=0.0, atol=1e-6))


def first_grouped(column: Iterable[str]) -> tuple[int, str, str] | None:
    """Row and text of the first number with a sign between thousands, and a whole number beside it; None for none.

    Every sign stands behind one to three digits and before exactly three, whole numbers below a thousand have none,
    and the column is smoother if the sign stands between thousands.
    """
    texts = [text.strip() for text in column]
    known = [(i, text) for i, text in enumerate(texts) if text]
    small = max((text for _, text in known if _SMALL.match(text)), key=lambda text: abs(int(text)), default="0")
    if abs(int(small)) < 100 or any(not _GROUPED.match(text) and not _SMALL.match(text) for _, text in known):
        return None
    as_decimals = np.array([float(text.replace(",", ".")) for _, text in known])
    as_thousands = np.array([float(text.replace(",", "").replace(".", "")) for _, text in known])
    if _roughness(as_decimals) <= _roughness(as_thousands):
        return None
    return next((i, text, small) for i, text in known if _GROUPED.match(text))


def _roughness(values: Array) -> float:
    """Square of the steps over that of the values (von Neumann's ratio): little where one sample follows the other."""
    spread = float(np.sum((values - values.mean()) ** 2))
    return float(np.sum(np.diff(values) ** 2)) / spread if spread > 0.0 else np.inf
