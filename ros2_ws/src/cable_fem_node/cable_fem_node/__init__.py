"""Prediction: the explicit cable solver (rods, solids, contact) and the winding model built on it."""
