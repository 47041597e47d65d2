"""Prediction error: the likelihood of a model with sensor noise and a torque disturbance, and its fit."""
