"""How cable is wound: configuration, checks, rod and solid, the prediction of a whole run."""
