"""Where are the markers, frame by frame and over the run?"""
