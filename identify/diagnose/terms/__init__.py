"""Terms that are tried beside a model to see what its residual torque depends on."""
