"""The simulated rig: plant, gyroscope and amplifier that answer as the bench would."""
