"""Many runs at once: what to vary, how to share the work, one table of what came out."""
