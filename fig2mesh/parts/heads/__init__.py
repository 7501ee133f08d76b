"""Heads in depth: skulls, hats, hair and what sticks out of them."""
