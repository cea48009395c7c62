"""What does the lay controller answer to which message, and which parameters does it have?"""
