"""The proof of a name: the torque that cancels the effect, what it left when it was played, and the verdict."""
