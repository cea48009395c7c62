"""What the evidence adds to the command `winding`."""
