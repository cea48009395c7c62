"""Explicit dynamics of nodes: time step, contact, loads, energy ledger, compilation."""
