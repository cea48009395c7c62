"""Where does the cable lie on the simulated machine: known ahead, or laid by its motion?"""
