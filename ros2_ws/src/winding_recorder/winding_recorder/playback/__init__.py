"""How does a recording run again: on topics, as a buffer, through one node's handler?"""
