"""What every report is made of: page, tables, pictures' style."""
