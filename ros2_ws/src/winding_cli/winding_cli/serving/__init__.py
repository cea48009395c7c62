"""Runs on request of a cell controller."""
