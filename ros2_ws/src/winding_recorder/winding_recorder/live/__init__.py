"""How is a running graph recorded, on disk and in memory?"""
