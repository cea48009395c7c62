"""The page's web server: what it serves, and to whom."""
