"""What does one frame change: where are markers expected, measured, found, and reported?"""
