"""One run that commissions a cell: its motion, what it determines, and what it leaves unknown."""
