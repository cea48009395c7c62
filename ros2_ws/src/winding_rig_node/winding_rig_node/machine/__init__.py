"""Which machine winds: axes, sensors, phases, commands, plausibility and faults, without ROS?"""
