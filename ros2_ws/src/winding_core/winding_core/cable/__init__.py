"""What is wound: the paper's cases, a cable's material, and the condition of a run."""
