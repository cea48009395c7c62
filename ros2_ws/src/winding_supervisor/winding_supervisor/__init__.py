"""Runs a graph: processes, lifecycle, supervision, the end of a run."""
