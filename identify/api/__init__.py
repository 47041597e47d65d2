"""From Python: arrays in, a result out that prints, shows in a notebook, plots and simulates."""
