"""What does the rig exchange with the graph: parameters, commands, sensors, pictures, status?"""
