"""What is noticed while a graph runs, and what is done about it?"""
