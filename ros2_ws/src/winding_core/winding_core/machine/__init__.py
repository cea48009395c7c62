"""What the winding machine is, measures and is commanded: axes, drive, readings, tension."""
