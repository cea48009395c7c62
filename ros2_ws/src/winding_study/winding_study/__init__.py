"""Offline questions: the twelve cases beside the paper, calibration of the rig, reports."""
