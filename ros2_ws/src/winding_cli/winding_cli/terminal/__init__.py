"""How does a command read its options, refuse, end, and print or write results?"""
