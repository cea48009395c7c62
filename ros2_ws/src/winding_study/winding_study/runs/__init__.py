"""Runs wound ahead: planned, stored, recorded."""
