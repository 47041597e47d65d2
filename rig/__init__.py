"""What the platform is and how to play on it: configuration, model, effects, excitation, recording."""
