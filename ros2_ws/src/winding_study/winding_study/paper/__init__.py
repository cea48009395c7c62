"""What are these numbers beside the paper's: its twelve cases, tables, models of h, report."""
