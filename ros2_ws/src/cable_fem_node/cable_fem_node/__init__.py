"""Prediction: the explicit cable solver (rods, solids, contact) and its winding model."""
