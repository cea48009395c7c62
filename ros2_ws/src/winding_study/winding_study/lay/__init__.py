"""Plans of a lay: what the machine can do, the solver's word on it, and a picture."""
