"""Which effects are named: fits compared, evidence, the searches."""
