"""From frame to frame: prediction of gates, measurement, acquisition, refinement."""
