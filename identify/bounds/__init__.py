"""What the runs can determine (Cramer-Rao), before and after they are played."""
