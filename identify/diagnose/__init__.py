"""What the residual depends on: motion, time, frequency, history."""
