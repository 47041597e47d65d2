"""Which runs and samples are used, which are held out, and what is refused."""
