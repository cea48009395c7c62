"""The winding model: configuration, live rod, solid, prediction of a whole run."""
