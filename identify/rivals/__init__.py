"""What else than an effect of the platform may explain the residual."""
