"""What does a run know of its machine, simulated or behind a driver of its own?"""
