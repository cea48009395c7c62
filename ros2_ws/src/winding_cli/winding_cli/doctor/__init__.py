"""Is this computer fit to run the graph, and what is to be done if it is not?"""
