"""Offline questions: the twelve cases beside the paper, sweeps, identification, plans."""
