"""Where the time goes between an exposure and a corrected length."""
