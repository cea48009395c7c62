"""How a cable lies: its path, the records of a lay, its errors and its programme."""
