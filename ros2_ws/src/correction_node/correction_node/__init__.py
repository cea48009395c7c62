"""Learned weight: data set, network, training, uncertainty, known conditions, correction."""
