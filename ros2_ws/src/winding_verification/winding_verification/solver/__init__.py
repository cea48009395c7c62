"""Verification of the solver: problems with reference answers, run by `winding verify`."""
