"""How does a cell test its driver and order runs?"""
