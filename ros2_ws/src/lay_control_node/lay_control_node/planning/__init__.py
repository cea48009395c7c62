"""Which motion and pull lay a program, and what of it is out of reach?"""
