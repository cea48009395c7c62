"""Do configuration, clocks, pose and guide fit what the pictures of the run show?"""
