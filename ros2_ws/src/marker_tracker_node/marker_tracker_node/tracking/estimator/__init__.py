"""One least squares over the sightings of a run: which configured number do they contradict?"""
