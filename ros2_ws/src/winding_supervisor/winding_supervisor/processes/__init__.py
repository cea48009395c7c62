"""How are the nodes of a graph started, brought up, matched and ended?"""
