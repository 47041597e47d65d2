"""Which effects are worth a fit: screening, score test, pairs. A bad proposal costs time, never a false name."""
