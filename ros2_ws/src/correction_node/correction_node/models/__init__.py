"""What gives the correction factor h, from which inputs, how far off may it be?"""
