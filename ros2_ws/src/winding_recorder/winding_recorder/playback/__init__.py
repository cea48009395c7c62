"""Recordings put back: onto topics, or through one node's message handler."""
