"""The library of cables: what is known of a cable, by its name."""
