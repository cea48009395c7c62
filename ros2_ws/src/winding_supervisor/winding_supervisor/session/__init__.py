"""How does a run, or a session of runs, begin, go on and end?"""
