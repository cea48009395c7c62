"""What does the tracker find when a configured number is wrong? Runs whose truth is known."""
