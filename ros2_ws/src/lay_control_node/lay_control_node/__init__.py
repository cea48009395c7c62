"""Where the cable is wanted, and the motion of the machine that lays it there."""
