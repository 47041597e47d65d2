"""Raw capture: every byte that crossed the wire, kept with its time."""
