"""What is the corrected length of a running machine, and what do its measured markers add?"""
