"""The camera as the tracker knows it: projection, calibration, recordings."""
