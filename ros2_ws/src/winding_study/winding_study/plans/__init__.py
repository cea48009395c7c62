"""Can the machine do a plan, and where does the solver lay it?"""
