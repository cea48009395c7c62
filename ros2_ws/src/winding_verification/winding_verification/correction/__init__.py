"""Research of the correction: the law within a run, and runs that do not repeat exactly."""
