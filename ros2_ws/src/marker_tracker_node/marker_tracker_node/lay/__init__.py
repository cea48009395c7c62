"""The whole lay from frames: every turn, the free span and what is wrong with them."""
