"""The excitation that separates two effects which the data leave alike."""
