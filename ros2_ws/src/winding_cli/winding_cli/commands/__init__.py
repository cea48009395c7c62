"""Subcommands of `winding`, one per file."""
