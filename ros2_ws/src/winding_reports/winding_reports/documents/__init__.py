"""What is every report made of: page, tables, style of pictures."""
