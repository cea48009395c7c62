"""What does each subcommand of `winding` take, and what does it call? One per file."""
