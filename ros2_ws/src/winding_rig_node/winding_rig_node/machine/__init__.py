"""The simulated machine: motors, encoders, controllers, load cell, faults and the true lay."""
