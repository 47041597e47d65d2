"""The model that is fitted: its structure, its parameter vector, the torque of its effects."""
