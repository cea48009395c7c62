"""Correction factor: data set, network, training, uncertainty, known conditions, correction."""
