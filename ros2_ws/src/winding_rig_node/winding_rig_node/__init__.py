"""The experiment and its clock: simulated winding machine, sensors and camera."""
