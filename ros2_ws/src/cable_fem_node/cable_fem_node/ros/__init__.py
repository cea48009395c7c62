"""What the solver's node answers to which message, and what works beside its thread."""
